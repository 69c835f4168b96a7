//! Maps of the MovingAI benchmarks, and lists of queries on them.
#![no_main]

use std::fmt::Write as _;

use libfuzzer_sys::fuzz_target;
use navigation::path::moving_ai::{self, Query, WrongFile};
use navigation::path::{Cell, Grid};

fuzz_target!(|text: &str| {
    match moving_ai::map(text) {
        Ok(grid) => drawn_again(&grid),
        Err(wrong) => placed(&wrong, text),
    }
    match moving_ai::queries(text) {
        Ok(queries) => listed_again(&queries),
        Err(wrong) => placed(&wrong, text),
    }
});

/// What is wrong can be shown.
fn placed(wrong: &WrongFile, text: &str) {
    assert!((1..=text.lines().count().max(1)).contains(&wrong.line), "{wrong}");
    assert!(!wrong.what.to_string().is_empty());
}

/// The map is the same when it is drawn and read again, with its head and without.
fn drawn_again(grid: &Grid) {
    let (width, height) = (grid.width(), grid.height());
    let letter = |x, y| if grid.is_taken(Cell::new(x, y)) { '@' } else { '.' };
    let rows = (0..height).map(|y| (0..width).map(|x| letter(x, y)).collect());
    let rows = rows.collect::<Vec<String>>().join("\n");
    for head in [format!("type octile\nheight {height}\nwidth {width}\nmap"), format!("{height} {width}")] {
        let again = moving_ai::map(&format!("{head}\n{rows}"));
        assert_eq!(again.as_ref(), Ok(grid));
    }
}

/// The queries are the same when they are written and read again.
fn listed_again(queries: &[Query]) {
    let Some(first) = queries.first() else { return };
    let mut text = if first.size.is_some() { "version 1".to_owned() } else { first.map.clone() };
    for Query { map, size, start, goal, length, .. } in queries {
        let _ = match size {
            Some((width, height)) => write!(
                text,
                "\n0 {map} {width} {height} {} {} {} {} {length}",
                start.x, start.y, goal.x, goal.y
            ),
            None => write!(text, "\n{} {} {} {} {length}", start.y, start.x, goal.y, goal.x),
        };
    }
    let again = moving_ai::queries(&text).unwrap_or_else(|wrong| panic!("{wrong}\n{text}"));
    assert_eq!(again.len(), queries.len());
    for (again, query) in again.iter().zip(queries) {
        // Lines between them are gone.
        assert_eq!(again, &Query { line: again.line, ..query.clone() });
    }
}
