//! What a robot is made of, as data. Every entry can be overridden by a table of the same names.

use types::value::{Mistake, Span, Table, TableReader};

use crate::colour::Colour;

/// A robot: a round body on two driven wheels, with its sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Radius of the body (m).
    pub radius: f64,
    /// Height of the body (m): what hangs higher does not touch it.
    pub height: f64,
    /// Colour of the body, as other robots see it.
    pub colour: Colour,
    /// Sectors of the bumper ring, 1 to 32; the first is centred straight ahead, the others follow to the left.
    pub bumper_sectors: u32,
    /// Wheels and motors.
    pub drive: Drive,
    /// The ring of sonars, if there is one.
    pub sonar: Option<Sonar>,
    /// The laser, if there is one.
    pub laser: Option<Laser>,
    /// The gyro.
    pub gyro: Gyro,
    /// The head that carries the camera.
    pub head: Head,
    /// The camera, if there is one.
    pub camera: Option<Camera>,
    /// The battery.
    pub battery: Battery,
}

/// Wheels, motors and encoders of a differential drive, with its errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Radius of a wheel as the robot believes it (m).
    pub wheel_radius: f64,
    /// Distance between the wheels as the robot believes it (m).
    pub axle: f64,
    /// Encoder ticks a turn of a wheel.
    pub ticks_per_turn: f64,
    /// Time constant with which a wheel follows its command (s); 0 follows at once.
    pub lag: f64,
    /// Highest wheel speed (rad/s).
    pub max_wheel_speed: f64,
    /// True radius of the left wheel over the believed one.
    pub left_scale: f64,
    /// True radius of the right wheel over the believed one.
    pub right_scale: f64,
    /// True distance of the wheels over the believed one.
    pub axle_scale: f64,
    /// Standard deviation of the slip of each wheel over one metre (m per √m).
    pub slip: f64,
    /// Without a command for this long the motors stop (s).
    pub watchdog: f64,
}

/// A ring of ultrasonic sensors on the rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sonar {
    /// Number of sensors, evenly spread; the first looks straight ahead, the others follow to the left. At most 64.
    pub count: u32,
    /// Height above the floor (m).
    pub height: f64,
    /// Half the opening angle of the cone (rad).
    pub half_angle: f64,
    /// Shortest range that can be told (m).
    pub min_range: f64,
    /// Longest range; also what is read without an echo (m).
    pub max_range: f64,
    /// A smooth face sends no echo back when the ray meets it more obliquely than this (rad from its normal).
    pub specular_angle: f64,
    /// Standard deviation in proportion to the range.
    pub relative_noise: f64,
    /// Standard deviation at range zero (m).
    pub noise: f64,
    /// Probability that a reading is a false short one.
    pub crosstalk: f64,
}

/// A scanning laser above the centre of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laser {
    /// Number of beams; the first looks furthest to the right. At most 4096.
    pub beams: u32,
    /// Angle between the first beam and the last (rad).
    pub field: f64,
    /// Height above the floor (m).
    pub height: f64,
    /// Longest range; also what is read without a return (m).
    pub max_range: f64,
    /// Standard deviation of a range (m).
    pub noise: f64,
    /// Probability that a beam does not return.
    pub dropout: f64,
}

/// A gyro about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyro {
    /// Standard deviation of the constant bias, drawn once a run (rad/s).
    pub bias: f64,
    /// Standard deviation of a reading (rad/s).
    pub noise: f64,
}

/// A head that turns and nods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Furthest turn to either side (rad).
    pub max_pan: f64,
    /// Furthest nod up or down (rad).
    pub max_tilt: f64,
    /// Speed of both joints (rad/s).
    pub speed: f64,
}

/// A camera on the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels in a row. At most 2048.
    pub width: u32,
    /// Rows. At most 2048.
    pub height: u32,
    /// Horizontal opening angle (rad).
    pub field: f64,
    /// Height above the floor (m).
    pub mount: f64,
    /// Standard deviation of the noise of a pixel (levels of 256).
    pub noise: f64,
}

/// A battery that drains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Battery {
    /// Energy when full (Wh).
    pub capacity: f64,
    /// Power of the electronics (W).
    pub idle: f64,
    /// Power of driving at one metre a second (W).
    pub drive: f64,
    /// Voltage when full (V).
    pub full: f64,
    /// Voltage when empty (V).
    pub empty: f64,
}

impl Default for Model {
    fn default() -> Model {
        Model::h1()
    }
}

impl Model {
    /// The exploring robot: 0.45 m wide, twelve sonars every 30°, a camera on a head, no laser.
    ///
    /// Sonar figures are those of the Polaroid transducer: a cone of ±15°, 0.15 to 6 m, 1 % and 2 cm.
    pub fn h1() -> Model {
        Model {
            radius: 0.225,
            height: 1.1,
            colour: Colour([150, 155, 165]),
            bumper_sectors: 12,
            drive: Drive {
                wheel_radius: 0.075,
                axle: 0.36,
                ticks_per_turn: 2000.0,
                lag: 0.1,
                max_wheel_speed: 10.0,
                left_scale: 1.0,
                right_scale: 1.0,
                axle_scale: 1.0,
                slip: 0.002,
                watchdog: 0.5,
            },
            sonar: Some(Sonar::default()),
            laser: None,
            gyro: Gyro { bias: 0.002, noise: 0.005 },
            head: Head { max_pan: 1.4, max_tilt: 0.6, speed: 1.5 },
            camera: Some(Camera::default()),
            battery: Battery { capacity: 120.0, idle: 25.0, drive: 60.0, full: 26.0, empty: 21.0 },
        }
    }

    /// The same robot with a laser of this many beams over this angle (rad): 10 mm of noise, 8 m.
    pub fn with_laser(mut self, beams: u32, field: f64) -> Model {
        self.laser = Some(Laser { beams, field, ..Laser::default() });
        self
    }

    /// [`Model::h1`] with every entry of `table` in place of its own; `at` is where the table stands.
    ///
    /// A sub-table `[sonar]`, `[laser]` or `[camera]` adds what the model has not; `sonar = false` takes it away.
    /// Gives nothing when there is a mistake, and all mistakes.
    pub fn read(table: &Table, at: Span, mistakes: &mut Vec<Mistake>) -> Option<Model> {
        Model::h1().overridden(table, at, &[], mistakes)
    }

    /// The same as [`Model::read`] on this model; `elsewhere` names the keys that somebody else reads.
    pub fn overridden(
        mut self,
        table: &Table,
        at: Span,
        elsewhere: &[&str],
        mistakes: &mut Vec<Mistake>,
    ) -> Option<Model> {
        let before = mistakes.len();
        let mut reader = TableReader::new(table, at, "the robot");
        elsewhere.iter().for_each(|key| reader.allow(key));
        set(&mut reader, "radius", 0.01, 0.5, &mut self.radius);
        set(&mut reader, "height", 0.01, 5.0, &mut self.height);
        set_count(&mut reader, "bumper_sectors", 1, 32, &mut self.bumper_sectors);
        if let Some(text) = reader.text("colour") {
            match Colour::read(text) {
                Some(colour) => self.colour = colour,
                None => {
                    let at = reader.place("colour");
                    let names = crate::colour::NAMES.map(|(name, _)| name);
                    reader.report(Mistake::unknown(at, "colour", text, names));
                }
            }
        }
        part(&mut reader, "drive", &mut self.drive, mistakes);
        part(&mut reader, "gyro", &mut self.gyro, mistakes);
        part(&mut reader, "head", &mut self.head, mistakes);
        part(&mut reader, "battery", &mut self.battery, mistakes);
        optional(&mut reader, "sonar", &mut self.sonar, mistakes);
        optional(&mut reader, "laser", &mut self.laser, mistakes);
        optional(&mut reader, "camera", &mut self.camera, mistakes);
        reader.finish(mistakes);
        (mistakes.len() == before).then_some(self)
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
        Some(types::value::Value::Bool(false)) => *slot = None,
        Some(types::value::Value::Bool(true)) => *slot = Some(slot.take().unwrap_or_default()),
        Some(_) => part(reader, key, slot.get_or_insert_with(T::default), mistakes),
    }
}

impl Default for Sonar {
    /// The Polaroid transducer in a ring of twelve.
    fn default() -> Sonar {
        Sonar {
            count: 12,
            height: 0.35,
            half_angle: 15.0f64.to_radians(),
            min_range: 0.15,
            max_range: 6.0,
            specular_angle: 25.0f64.to_radians(),
            relative_noise: 0.01,
            noise: 0.02,
            crosstalk: 0.02,
        }
    }
}

impl Sonar {
    /// Where sensor `which` looks, to the left of straight ahead (rad). It sits on the rim in that direction.
    pub fn bearing(&self, which: u32) -> f64 {
        types::geometry::TAU * f64::from(which) / f64::from(self.count)
    }
}

impl Default for Laser {
    /// A small scanner of half a turn, one beam a degree.
    fn default() -> Laser {
        Laser {
            beams: 180,
            field: std::f64::consts::PI,
            height: 0.35,
            max_range: 8.0,
            noise: 0.01,
            dropout: 0.002,
        }
    }
}

impl Default for Camera {
    /// A web camera at the height of a table lamp.
    fn default() -> Camera {
        Camera { width: 320, height: 240, field: 60.0f64.to_radians(), mount: 1.0, noise: 3.0 }
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
    }
}

impl Part for Sonar {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "count", 1, 64, &mut self.count);
        set(r, "height", 0.0, 5.0, &mut self.height);
        set(r, "half_angle", 0.001, 1.5, &mut self.half_angle);
        set(r, "min_range", 0.0, 10.0, &mut self.min_range);
        set(r, "max_range", 0.01, 100.0, &mut self.max_range);
        set(r, "specular_angle", 0.0, 1.6, &mut self.specular_angle);
        set(r, "relative_noise", 0.0, 1.0, &mut self.relative_noise);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
        set(r, "crosstalk", 0.0, 1.0, &mut self.crosstalk);
    }
}

impl Part for Laser {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "beams", 1, 4096, &mut self.beams);
        set(r, "field", 0.0, types::geometry::TAU, &mut self.field);
        set(r, "height", 0.0, 5.0, &mut self.height);
        set(r, "max_range", 0.01, 1000.0, &mut self.max_range);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
        set(r, "dropout", 0.0, 1.0, &mut self.dropout);
    }
}

impl Part for Gyro {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "bias", 0.0, 1.0, &mut self.bias);
        set(r, "noise", 0.0, 1.0, &mut self.noise);
    }
}

impl Part for Head {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "max_pan", 0.0, 3.2, &mut self.max_pan);
        set(r, "max_tilt", 0.0, 1.2, &mut self.max_tilt);
        set(r, "speed", 0.01, 100.0, &mut self.speed);
    }
}

impl Part for Camera {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set_count(r, "width", 1, 2048, &mut self.width);
        set_count(r, "height", 1, 2048, &mut self.height);
        set(r, "field", 0.05, 2.8, &mut self.field);
        set(r, "mount", 0.01, 5.0, &mut self.mount);
        set(r, "noise", 0.0, 30.0, &mut self.noise);
    }
}

impl Part for Battery {
    fn read(&mut self, r: &mut TableReader<'_>) {
        set(r, "capacity", 0.001, 1e6, &mut self.capacity);
        set(r, "idle", 0.0, 1e4, &mut self.idle);
        set(r, "drive", 0.0, 1e4, &mut self.drive);
        set(r, "full", 0.0, 1000.0, &mut self.full);
        set(r, "empty", 0.0, 1000.0, &mut self.empty);
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
        let model = Model::read(&table, Span::default(), &mut mistakes).unwrap();
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
        assert_eq!(Model::read(&table, Span::default(), &mut mistakes), None);
        let said: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said.iter().any(|text| text.contains("did you mean \"lag\"")), "{said:?}");
    }
}
