//! What sonars and lasers measure.

use super::*;

#[test]
fn a_wall_ahead_is_heard_at_its_distance_and_a_slanting_one_at_its_foot() {
    for degrees in [-12.0f64, -5.0, 0.0, 3.0, 10.0] {
        let normal = Point::polar(1.0, degrees.to_radians());
        let (foot, along) = (normal * 3.0, Point::new(-normal.y, normal.x) * 12.0);
        let plan = WorldPlan { walls: vec![wall(foot - along, foot + along)], ..WorldPlan::default() };
        let (world, id) = alone(&plan, exact(), Pose::default());
        let echo = world.sonar_echo(id, 0).unwrap().unwrap();
        // The transducer sits on the rim; the foot of the perpendicular lies inside its cone.
        let expected = 3.0 - 0.225 * degrees.to_radians().cos();
        assert!((echo / expected - 1.0).abs() < 1.2e-3, "{degrees}: {echo} {expected}");
    }
}

#[test]
fn a_smooth_wall_that_is_too_oblique_sends_no_echo_but_its_edge_does() {
    let direction = Point::polar(1.0, 45f64.to_radians());
    let from = Point::new(2.0, -0.3);
    let long = WorldPlan {
        walls: vec![wall(from - direction * 20.0, from + direction * 20.0)],
        ..WorldPlan::default()
    };
    let mut model = exact();
    if let Some(sonar) = &mut model.sonar {
        sonar.specular_angle = 25f64.to_radians();
    }
    let (world, id) = alone(&long, model.clone(), Pose::default());
    assert_eq!(world.sonar_echo(id, 0), Some(None));
    let mut reading = [0.0f32; 12];
    assert_eq!(world.sonar(id, 0, &mut reading), 12);
    assert_eq!(reading[0], 6.0, "no echo reads as the longest range");
    let short = WorldPlan { walls: vec![wall(from, from + direction * 20.0)], ..WorldPlan::default() };
    let (world, id) = alone(&short, model, Pose::default());
    let edge = world.sonar_echo(id, 0).unwrap().unwrap();
    assert!((edge - from.distance(Point::new(0.225, 0.0))).abs() < 1e-9, "{edge}");
}

#[test]
fn a_thin_pole_between_the_rays_is_heard_and_one_beside_the_cone_is_not() {
    for (degrees, heard) in [(2.5f64, true), (-7.5, true), (14.0, true), (17.0, false)] {
        let at = Point::new(0.225, 0.0) + Point::polar(3.0, degrees.to_radians());
        let round = Round { at, radius: 0.01, height: 1.0, ..Round::default() };
        let (world, id) =
            alone(&WorldPlan { rounds: vec![round], ..WorldPlan::default() }, exact(), Pose::default());
        let echo = world.sonar_echo(id, 0).unwrap();
        assert_eq!(echo.is_some(), heard, "{degrees}");
        assert!(echo.is_none_or(|echo| (echo - 2.99).abs() < 1e-9));
    }
}

#[test]
fn an_edge_behind_a_wall_is_not_heard() {
    let screen = wall(Point::new(1.5, -3.0), Point::new(1.5, 3.0));
    let pole = Round { at: Point::new(2.5, 0.0), radius: 0.05, height: 1.0, ..Round::default() };
    let plan = WorldPlan { walls: vec![screen], rounds: vec![pole], ..WorldPlan::default() };
    let (world, id) = alone(&plan, exact(), Pose::default());
    assert!((world.sonar_echo(id, 0).unwrap().unwrap() - 1.275).abs() < 1e-9);
}

#[test]
fn the_noise_of_a_sonar_has_its_parameters() {
    let (world, id) = alone(&WorldPlan::hall(8.0, 8.0), Model::h1(), Pose::new(4.0, 4.0, 0.0));
    let truth = 4.0 - 0.225;
    let sigma = 0.02 + 0.01 * truth;
    let n = 40_000u64;
    let readings: Vec<f64> = (0..n).map(|k| f64::from(world.sonar_range(id, 0, k).unwrap())).collect();
    let near: Vec<f64> = readings.iter().copied().filter(|x| (x - truth).abs() < 4.0 * sigma).collect();
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    let variance = near.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / near.len() as f64;
    // What crosstalk puts into the band by chance is a thousandth of all.
    assert!((mean - truth).abs() < 0.002, "{mean}");
    assert!((variance.sqrt() / sigma - 1.0).abs() < 0.03, "{} {sigma}", variance.sqrt());
    let short = readings.iter().filter(|&&x| x < truth - 5.0 * sigma).count() as f64 / n as f64;
    let expected = 0.02 * (truth - 5.0 * sigma - 0.15) / (truth - 0.15);
    assert!((short - expected).abs() < 0.002, "{short} {expected}");
}

#[test]
fn a_laser_measures_a_hall() {
    let mut model = exact().with_laser(181, PI);
    if let Some(laser) = &mut model.laser {
        laser.dropout = 0.0;
    }
    let (world, id) = alone(&WorldPlan::hall(6.0, 4.0), model, Pose::new(2.0, 1.0, 0.0));
    let n = 500u64;
    let (mut ranges, mut sums) = (vec![0.0f32; 181], vec![0.0f64; 181]);
    let mut square = 0.0;
    for k in 0..n {
        assert_eq!(world.scan(id, k, &mut ranges), 181);
        sums.iter_mut().zip(&ranges).for_each(|(sum, &range)| *sum += f64::from(range));
        square += (f64::from(ranges[90]) - 4.0).powi(2);
    }
    for (k, sum) in sums.iter().enumerate() {
        let angle = (k as f64 - 90.0).to_radians();
        let side = if angle < 0.0 { 1.0 / -angle.sin() } else { 3.0 / angle.sin().max(1e-12) };
        let expected = side.min(4.0 / angle.cos().max(1e-12));
        assert!((sum / n as f64 - expected).abs() < 0.003, "beam {k}: {} {expected}", sum / n as f64);
    }
    assert!(((square / n as f64).sqrt() / 0.01 - 1.0).abs() < 0.1);
}
