//! Reading a model: a named one, with what a table says in its place.

use types::Duration;
use types::geometry::{PI, TAU};
use types::value::{Mistake, Span, Table, TableReader, Value};

use super::{
    Battery, Camera, Drive, Gyro, Head, Infrared, LandmarkSensor, Laser, Model, NAMES, Shape, Sonar,
};
use crate::colour::Colour;
use crate::read::{not_an_angle, read_angle};

/// A sensor that is read more often than the robot's cycle gives nothing more; one that is read less often than this is off.
const PERIODS: (Duration, Duration) = (Duration::millis(1), Duration::secs(3600));

impl Model {
    /// The model that a robot's table names with `model` (else [`Model::h1`]), with every entry of the table in place of its own.
    ///
    /// `radius` makes a round body, `body = { length = 0.5, width = 0.4 }` a rectangular one. A sub-table `[sonar]`, `[laser]`,
    /// `[camera]`, `[landmarks]` or `[infrared]` adds what the model has not; `sonar = false` takes it away. `at` is where the table stands, and `elsewhere`
    /// names the keys that somebody else reads. Gives nothing when there is a mistake, and all mistakes.
    pub fn read(table: &Table, at: Span, elsewhere: &[&str], mistakes: &mut Vec<Mistake>) -> Option<Model> {
        let before = mistakes.len();
        let mut reader = TableReader::new(table, at, "the robot");
        elsewhere.iter().for_each(|key| reader.allow(key));
        let mut model = base(&mut reader);
        read_shape(&mut reader, &mut model.shape, mistakes);
        set(&mut reader, "height", 0.01, 5.0, &mut model.height);
        set_count(&mut reader, "bumper_sectors", 1, 32, &mut model.bumper_sectors);
        set_period(&mut reader, "bumper_period", &mut model.bumper_period);
        if let Some(text) = reader.text("colour") {
            match Colour::read(text) {
                Some(colour) => model.colour = colour,
                None => {
                    let at = reader.place("colour");
                    let names = crate::colour::NAMES.map(|(name, _)| name);
                    reader.report(Mistake::unknown(at, "colour", text, names));
                }
            }
        }
        part(&mut reader, "drive", &mut model.drive, mistakes);
        part(&mut reader, "gyro", &mut model.gyro, mistakes);
        part(&mut reader, "head", &mut model.head, mistakes);
        part(&mut reader, "battery", &mut model.battery, mistakes);
        optional(&mut reader, "sonar", &mut model.sonar, mistakes);
        optional(&mut reader, "laser", &mut model.laser, mistakes);
        optional(&mut reader, "camera", &mut model.camera, mistakes);
        optional(&mut reader, "landmarks", &mut model.landmarks, mistakes);
        optional(&mut reader, "infrared", &mut model.infrared, mistakes);
        reader.finish(mistakes);
        (mistakes.len() == before).then_some(model)
    }
}

/// The model that is named, or the usual one.
fn base(reader: &mut TableReader<'_>) -> Model {
    let Some(name) = reader.text("model") else { return Model::h1() };
    Model::named(name).unwrap_or_else(|| {
        let at = reader.place("model");
        reader.report(Mistake::unknown(at, "model", name, NAMES));
        Model::h1()
    })
}

fn read_shape(reader: &mut TableReader<'_>, shape: &mut Shape, mistakes: &mut Vec<Mistake>) {
    let round = reader.float_in("radius", 0.01, 2.0);
    let at = reader.place("body");
    if let Some(table) = reader.table("body") {
        let mut inner = TableReader::new(table, at, "\"body\"");
        let (mut length, mut width, mut ahead) = match *shape {
            Shape::Rectangle { length, width, ahead } => (length, width, ahead),
            Shape::Round { radius } => (2.0 * radius, 2.0 * radius, 0.0),
        };
        set(&mut inner, "length", 0.02, 4.0, &mut length);
        set(&mut inner, "width", 0.02, 4.0, &mut width);
        set(&mut inner, "ahead", -2.0, 2.0, &mut ahead);
        if 2.0 * libm::fabs(ahead) >= length {
            let at = inner.place("ahead");
            inner.report(Mistake::new(at, "the point between the wheels must lie under the body"));
        }
        inner.finish(mistakes);
        *shape = Shape::Rectangle { length, width, ahead };
        if round.is_some() {
            let at = reader.place("radius");
            reader.report(Mistake::new(at, "a body is round or rectangular: give \"radius\" or \"body\""));
        }
    } else if let Some(radius) = round {
        *shape = Shape::Round { radius };
    }
}

/// A part of the model that a table can override.
trait Part {
    fn read(&mut self, reader: &mut TableReader<'_>);
}

fn set(reader: &mut TableReader<'_>, key: &str, least: f64, most: f64, value: &mut f64) {
    if let Some(x) = reader.float_in(key, least, most) {
        *value = x;
    }
}

/// An angle, as a number in radians or a text such as `"270deg"`.
fn set_angle(reader: &mut TableReader<'_>, key: &str, least: f64, most: f64, value: &mut f64) {
    let Some(entry) = reader.entry(key) else { return };
    match read_angle(&entry.value) {
        // A hair more: 360° may be a little more than a full turn.
        Some(angle) if (least - 1e-9..=most + 1e-9).contains(&angle) => *value = angle.clamp(least, most),
        Some(angle) => {
            let what = format!("\"{key}\" is {angle} rad, it must lie from {least:.4} to {most:.4}");
            reader.report(Mistake::new(entry.at, what));
        }
        None => reader.report(not_an_angle(key, entry)),
    }
}

fn set_truth(reader: &mut TableReader<'_>, key: &str, value: &mut bool) {
    if let Some(truth) = reader.bool(key) {
        *value = truth;
    }
}

fn set_period(reader: &mut TableReader<'_>, key: &str, value: &mut Duration) {
    let Some(period) = reader.duration(key) else { return };
    if (PERIODS.0..=PERIODS.1).contains(&period) {
        *value = period;
    } else {
        let at = reader.place(key);
        let what = format!("\"{key}\" is {period}, it must lie from {} to {}", PERIODS.0, PERIODS.1);
        reader.report(Mistake::new(at, what));
    }
}

fn set_count(reader: &mut TableReader<'_>, key: &str, least: i64, most: i64, value: &mut u32) {
    if let Some(n) = reader.int(key) {
        if (least..=most).contains(&n) {
            *value = n as u32;
        } else {
            let at = reader.place(key);
            reader.report(Mistake::new(at, format!("\"{key}\" is {n}, it must lie from {least} to {most}")));
        }
    }
}

fn part(reader: &mut TableReader<'_>, key: &str, part: &mut impl Part, mistakes: &mut Vec<Mistake>) {
    let at = reader.place(key);
    if let Some(table) = reader.table(key) {
        let mut inner = TableReader::new(table, at, format!("\"{key}\""));
        part.read(&mut inner);
        inner.finish(mistakes);
    }
}

fn optional<T: Part + Default>(
    reader: &mut TableReader<'_>,
    key: &str,
    slot: &mut Option<T>,
    mistakes: &mut Vec<Mistake>,
) {
    match reader.entry(key).map(|entry| &entry.value) {
        None => {}
        Some(Value::Bool(false)) => *slot = None,
        Some(Value::Bool(true)) => *slot = Some(slot.take().unwrap_or_default()),
        Some(_) => part(reader, key, slot.get_or_insert_with(T::default), mistakes),
    }
}

impl Part for Drive {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "wheel_radius", 0.001, 1.0, &mut self.wheel_radius);
        set(r, "axle", 0.01, 5.0, &mut self.axle);
        set(r, "ticks_per_turn", 1.0, 1e7, &mut self.ticks_per_turn);
        set(r, "lag", 0.0, 10.0, &mut self.lag);
        set(r, "max_wheel_speed", 0.0, 100.0, &mut self.max_wheel_speed);
        set(r, "left_scale", 0.5, 2.0, &mut self.left_scale);
        set(r, "right_scale", 0.5, 2.0, &mut self.right_scale);
        set(r, "axle_scale", 0.5, 2.0, &mut self.axle_scale);
        set(r, "slip", 0.0, 1.0, &mut self.slip);
        set(r, "watchdog", 0.01, 3600.0, &mut self.watchdog);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Sonar {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "count", 1, 64, &mut self.count);
        set(r, "height", 0.0, 5.0, &mut self.height);
        set_angle(r, "half_angle", 0.001, 1.5, &mut self.half_angle);
        set(r, "min_range", 0.0, 10.0, &mut self.min_range);
        set(r, "max_range", 0.01, 100.0, &mut self.max_range);
        set_angle(r, "specular_angle", 0.0, 1.6, &mut self.specular_angle);
        set(r, "relative_noise", 0.0, 1.0, &mut self.relative_noise);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
        set(r, "crosstalk", 0.0, 1.0, &mut self.crosstalk);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Laser {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "beams", 1, 4096, &mut self.beams);
        set_angle(r, "field", 0.0, TAU, &mut self.field);
        set(r, "x", -2.0, 2.0, &mut self.x);
        set(r, "y", -2.0, 2.0, &mut self.y);
        set_angle(r, "heading", -PI, PI, &mut self.heading);
        set(r, "height", 0.0, 5.0, &mut self.height);
        set(r, "max_range", 0.01, 1000.0, &mut self.max_range);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
        set(r, "dropout", 0.0, 1.0, &mut self.dropout);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for LandmarkSensor {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_angle(r, "field", 0.0, TAU, &mut self.field);
        set_truth(r, "on_head", &mut self.on_head);
        set(r, "height", 0.0, 5.0, &mut self.height);
        set(r, "min_range", 0.0, 100.0, &mut self.min_range);
        set(r, "max_range", 0.01, 100.0, &mut self.max_range);
        set(r, "relative_noise", 0.0, 1.0, &mut self.relative_noise);
        set(r, "noise", 0.0, 10.0, &mut self.noise);
        set_angle(r, "bearing_noise", 0.0, PI, &mut self.bearing_noise);
        set_truth(r, "identifies", &mut self.identifies);
        set(r, "miss", 0.0, 1.0, &mut self.miss);
        set(r, "mistake", 0.0, 1.0, &mut self.mistake);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Infrared {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "height", 0.0, 5.0, &mut self.height);
        set(r, "max_range", 0.01, 100.0, &mut self.max_range);
        set(r, "miss", 0.0, 1.0, &mut self.miss);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Gyro {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "bias", 0.0, 1.0, &mut self.bias);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Head {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_angle(r, "max_pan", 0.0, 3.2, &mut self.max_pan);
        set_angle(r, "max_tilt", 0.0, 1.2, &mut self.max_tilt);
        set(r, "speed", 0.01, 100.0, &mut self.speed);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Camera {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "width", 1, 2048, &mut self.width);
        set_count(r, "height", 1, 2048, &mut self.height);
        set_angle(r, "field", 0.05, 2.8, &mut self.field);
        set(r, "mount", 0.01, 5.0, &mut self.mount);
        set(r, "noise", 0.0, 30.0, &mut self.noise);
        set_period(r, "period", &mut self.period);
    }
}

impl Part for Battery {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "capacity", 0.001, 1e6, &mut self.capacity);
        set(r, "idle", 0.0, 1e4, &mut self.idle);
        set(r, "drive", 0.0, 1e4, &mut self.drive);
        set(r, "full", 0.0, 1000.0, &mut self.full);
        set(r, "empty", 0.0, 1000.0, &mut self.empty);
        set_period(r, "period", &mut self.period);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::value::Value;

    #[test]
    fn a_table_overrides_what_it_names_and_nothing_else() {
        let mut table = Table::new();
        table.set_path("drive.lag", Value::from(0.3)).unwrap();
        table.set_path("laser.beams", Value::from(360)).unwrap();
        table.set_path("camera", Value::from(false)).unwrap();
        let mut mistakes = Vec::new();
        let model = Model::read(&table, Span::default(), &[], &mut mistakes).unwrap();
        assert_eq!(model.drive, Drive { lag: 0.3, ..Model::h1().drive });
        assert_eq!(model.laser, Some(Laser { beams: 360, ..Laser::default() }));
        assert_eq!(model.camera, None);
        assert_eq!(model.sonar, Model::h1().sonar);
    }

    #[test]
    fn all_mistakes_of_a_robot_are_told_at_once() {
        let mut table = Table::new();
        table.set_path("drive.lga", Value::from(0.3)).unwrap();
        table.set_path("sonar.count", Value::from(0)).unwrap();
        table.set_path("radius", Value::from("wide")).unwrap();
        let mut mistakes = Vec::new();
        assert_eq!(Model::read(&table, Span::default(), &[], &mut mistakes), None);
        let said: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said.iter().any(|text| text.contains("did you mean \"lag\"")), "{said:?}");
    }

    fn read(pairs: &[(&str, Value)]) -> Result<Model, Vec<String>> {
        let mut table = Table::new();
        pairs.iter().for_each(|(key, value)| table.set_path(key, value.clone()).unwrap());
        let mut mistakes = Vec::new();
        let model = Model::read(&table, Span::default(), &[], &mut mistakes);
        model.ok_or_else(|| mistakes.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn a_body_is_round_or_rectangular_and_a_name_gives_the_rest() {
        let boxy = read(&[("body.length", 0.51.into()), ("body.width", 0.43.into())]).unwrap();
        assert_eq!(boxy.shape, Shape::Rectangle { length: 0.51, width: 0.43, ahead: 0.0 });
        let r1 = read(&[("model", "r1".into()), ("height", 0.9.into())]).unwrap();
        assert_eq!(r1, Model { height: 0.9, ..Model::r1() });
        for name in NAMES {
            assert!(Model::named(name).is_some(), "{name}");
        }
        let said = read(&[("model", "jakal".into())]).unwrap_err();
        assert!(said[0].contains("did you mean \"jackal\""), "{said:?}");
        let said = read(&[("radius", 0.3.into()), ("body.length", 0.4.into())]).unwrap_err();
        assert!(said[0].contains("round or rectangular"), "{said:?}");
        let said = read(&[("body.ahead", 0.3.into())]).unwrap_err();
        assert!(said[0].contains("under the body"), "{said:?}");
    }

    #[test]
    fn angles_and_periods_have_units() {
        let model = read(&[
            ("laser.field", "270deg".into()),
            ("laser.x", (-0.065).into()),
            ("laser.period", "25ms".into()),
            ("sonar.period", "100ms".into()),
        ]);
        let model = model.unwrap();
        let laser = Laser { field: 1.5 * PI, x: -0.065, period: Duration::millis(25), ..Laser::default() };
        assert_eq!(model.laser, Some(laser));
        assert_eq!(model.sonar.map(|sonar| sonar.period), Some(Duration::millis(100)));
        let said = read(&[("laser.field", "400deg".into()), ("gyro.period", "0s".into())]).unwrap_err();
        assert_eq!(said.len(), 2, "{said:?}");
    }
}
