//! What a camera sees.

use super::*;

/// The smallest rectangle of red pixels: left, right, top, bottom, each as the border of the pixels.
fn red(image: &[u8], width: usize) -> Option<[f64; 4]> {
    let mut found: Option<[f64; 4]> = None;
    for (k, pixel) in image.chunks_exact(3).enumerate() {
        if pixel[0] > 60 && pixel[1] < pixel[0] / 3 && pixel[2] < pixel[0] / 3 {
            let (x, y) = ((k % width) as f64, (k / width) as f64);
            let [left, right, top, bottom] = found.unwrap_or([x, x, y, y]);
            found = Some([left.min(x), right.max(x + 1.0), top.min(y), bottom.max(y + 1.0)]);
        }
    }
    found
}

#[test]
fn a_red_ball_covers_the_pixels_of_the_pinhole() {
    let camera = Camera { noise: 0.0, ..Camera::default() };
    let focal = 160.0 / 30f64.to_radians().tan();
    for (distance, degrees, radius, pan, tilt) in [
        (3.0, 0.0f64, 0.15, 0.0, 0.0f64),
        (2.0, 10.0, 0.12, 0.0, 0.0),
        (4.0, -20.0, 0.2, -0.2, 0.0),
        (2.5, 35.0, 0.14, 0.5, 0.2),
    ] {
        let bearing = degrees.to_radians();
        let thing = Thing {
            name: "ball".into(),
            at: Point::polar(distance, bearing),
            radius,
            height: 1.0,
            ..Thing::default()
        };
        let mut plan = WorldPlan::hall(1.0, 1.0);
        plan.walls[0].line.iter_mut().for_each(|corner| *corner = (*corner - Point::new(0.5, 0.5)) * 14.0);
        plan.things.push(thing);
        let (mut world, id) = alone(&plan, Model { camera: Some(camera), ..exact() }, Pose::default());
        world.command_head(id, pan, tilt);
        world.run_until(Time::from_seconds(1.0));
        let mut image = vec![0u8; 320 * 240 * 3];
        assert_eq!(world.render(id, 0, &mut Canvas::default(), &mut image), Some((320, 240)));
        let [left, right, top, bottom] = red(&image, 320).unwrap();
        // The ball at the height of the camera is seen under ± asin(r / d) to either side.
        let half = (radius / distance).asin();
        let aside = bearing - pan;
        let column = |angle: f64| 160.0 - focal * angle.tan();
        assert!((left - column(aside + half)).abs() < 1.0, "left {left} {}", column(aside + half));
        assert!((right - column(aside - half)).abs() < 1.0, "right {right} {}", column(aside - half));
        // In the column through its middle the picture plane is further away by 1 / cos.
        let rise = focal / aside.cos() * half.tan();
        let horizon = 120.0 + focal * tilt.tan();
        assert!((top - (horizon - rise)).abs() < 1.0, "top {top} {}", horizon - rise);
        assert!((bottom - (horizon + rise)).abs() < 1.0, "bottom {bottom} {}", horizon + rise);
        assert_eq!(Pinhole::new(&camera, tilt).horizon, horizon);
    }
}

#[test]
fn what_stands_in_front_hides_what_is_behind() {
    let mut plan = WorldPlan::hall(8.0, 4.0);
    plan.things.push(Thing { name: "ball".into(), at: Point::new(6.0, 2.0), ..Thing::default() });
    let seen = |plan: &WorldPlan| {
        let (world, id) = alone(plan, exact(), Pose::new(1.0, 2.0, 0.0));
        let mut image = vec![0u8; 320 * 240 * 3];
        world.render(id, 0, &mut Canvas::default(), &mut image).unwrap();
        red(&image, 320).is_some()
    };
    assert!(seen(&plan));
    plan.people.push(Person { at: Point::new(3.0, 2.0), ..Person::default() });
    assert!(!seen(&plan), "a person stands before it");
    plan.people[0].at = Point::new(7.0, 2.0);
    assert!(seen(&plan), "the person stands behind it");
    plan.walls.push(wall(Point::new(4.0, 1.0), Point::new(4.0, 3.0)));
    assert!(!seen(&plan), "a wall stands before it");
    plan.walls[1].height = 0.7;
    assert!(seen(&plan), "one sees over a low wall");
}

#[test]
fn a_canvas_keeps_nothing_of_the_picture_before() {
    let mut plan = WorldPlan::hall(8.0, 4.0);
    plan.people.push(Person { at: Point::new(3.0, 2.0), ..Person::default() });
    let picture = |width: u32, height: u32, heading: f64, canvas: &mut Canvas| {
        let camera = Camera { width, height, ..Camera::default() };
        let (world, id) =
            alone(&plan, Model { camera: Some(camera), ..exact() }, Pose::new(1.0, 2.0, heading));
        let mut image = vec![0u8; (width * height * 3) as usize];
        world.render(id, 0, canvas, &mut image).unwrap();
        image
    };
    let mut kept = Canvas::default();
    for (width, height, heading) in [(320, 240, 0.0), (81, 50, PI), (33, 60, 0.1), (320, 240, PI)] {
        let image = picture(width, height, heading, &mut kept);
        assert_eq!(image, picture(width, height, heading, &mut Canvas::default()), "{width} x {height}");
    }
}

#[test]
fn the_noise_of_a_picture_has_its_deviation() {
    let mut model = exact();
    let (clear, id) = alone(&WorldPlan::hall(6.0, 4.0), model.clone(), Pose::new(2.0, 2.0, 0.0));
    model.camera = Some(Camera { noise: 5.0, ..Camera::default() });
    let (noisy, _) = alone(&WorldPlan::hall(6.0, 4.0), model, Pose::new(2.0, 2.0, 0.0));
    let mut images = [vec![0u8; 320 * 240 * 3], vec![0u8; 320 * 240 * 3], vec![0u8; 320 * 240 * 3]];
    clear.render(id, 0, &mut Canvas::default(), &mut images[0]).unwrap();
    noisy.render(id, 0, &mut Canvas::default(), &mut images[1]).unwrap();
    noisy.render(id, 1, &mut Canvas::default(), &mut images[2]).unwrap();
    assert_ne!(images[1], images[2]);
    let (mut sum, mut square) = (0.0, 0.0);
    for (a, b) in images[0].iter().zip(&images[1]) {
        let difference = f64::from(*b) - f64::from(*a);
        sum += difference;
        square += difference * difference;
    }
    let n = images[0].len() as f64;
    assert!((sum / n).abs() < 0.2, "{}", sum / n);
    assert!(((square / n).sqrt() / 5.0 - 1.0).abs() < 0.05, "{}", (square / n).sqrt());
}
