//! Measures each step of the picture chain on a 320 × 240 picture: `cargo run --release -p sinew-perception --example speed`.
//!
//! Three pictures: noise, in which every pixel has another colour (the worst for tables and for regions), a scene of
//! smooth shades with red discs, and a plain one. The least and the middle of 400 runs are printed.
#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "it measures and prints; the library does neither"
)]

use perception::Size;
use perception::blobs::{BlobFinder, BlobParams};
use perception::colour::{ColourRange, Converter, in_range, intensity};
use perception::edges::sobel;
use perception::laser::{Beams, reduce};
use perception::motion::{MotionParams, motion};
use perception::sonar::{FilterParams, SonarFilter};
use std::hint::black_box;
use std::time::Instant;

const SIZE: Size = Size::new(320, 240);

fn main() {
    let pictures = [("noise", noise()), ("scene", scene()), ("plain", vec![90; 3 * SIZE.pixels()])];
    for (name, rgb) in pictures {
        println!("{name}");
        measure_picture(&rgb);
    }
    println!("ranges");
    measure_ranges();
}

fn measure_picture(rgb: &[u8]) {
    let converter = Converter::new();
    let range = ColourRange::default();
    let mut hsi = vec![0; rgb.len()];
    let [mut mask, mut grey, mut edges, mut moved] = [const { Vec::new() }; 4].map(|mut v: Vec<u8>| {
        v.resize(SIZE.pixels(), 0);
        v
    });
    let mut finder = BlobFinder::<32>::new(SIZE, BlobParams::default());
    measure("RGB to HSI", || converter.convert(black_box(rgb), &mut hsi).is_ok());
    measure("split", || in_range(black_box(&hsi), &range, &mut mask).is_ok());
    measure("blobs", || finder.find(black_box(&mask)).is_ok());
    measure("intensity", || intensity(black_box(&hsi), &mut grey).is_ok());
    measure("Sobel", || sobel(black_box(&grey), SIZE, &mut edges).is_ok());
    measure("motion", || {
        motion(black_box(&grey), &edges, SIZE, &MotionParams::default(), &mut moved).is_ok()
    });
}

fn measure_ranges() {
    let (mut filter, mut filtered) = (SonarFilter::new(FilterParams::default()), [0.0; 12]);
    measure("12 sonars", || filter.update(black_box(&[2.0; 12]), 0.25, &mut filtered).is_ok());
    let (ranges, mount) = ([3.0; 181], types::Pose::new(0.2, 0.0, 0.0));
    measure("181 beams", || reduce(&Beams::default(), black_box(&ranges), mount, &mut filtered).is_ok());
}

fn measure(what: &str, mut work: impl FnMut() -> bool) {
    let mut micros: Vec<f64> = (0..400)
        .map(|_| {
            let start = Instant::now();
            assert!(black_box(work()));
            start.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    micros.sort_by(f64::total_cmp);
    println!("  {what:<12} least {:7.1} µs, middle {:7.1} µs", micros[0], micros[200]);
}

fn noise() -> Vec<u8> {
    let mut state = 1u32;
    (0..3 * SIZE.pixels())
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .collect()
}

fn scene() -> Vec<u8> {
    let grain = noise();
    let disc = |x: usize, y: usize, cx: usize, cy: usize, r: usize| {
        x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2) < r * r
    };
    let pixel = |i: usize| {
        let (x, y) = (i % SIZE.width, i / SIZE.width);
        if disc(x, y, 100, 90, 40) || disc(x, y, 250, 160, 15) {
            [200, 30, 40]
        } else {
            [60 + x / 4, 80 + y / 4, 120 - x / 8].map(|c| c as u8)
        }
    };
    (0..SIZE.pixels()).flat_map(|i| pixel(i).map(|c| c.saturating_add(grain[i] % 12))).collect()
}
