//! What a robot is made of, as data. Every entry can be overridden by a table of the same names.

mod read;

use types::geometry::wrap;
use types::{Duration, Point, Pose};

use crate::colour::Colour;
use crate::shape::Circle;
use crate::solid::{Rectangle, Solid};

/// A robot: a round or rectangular body on two driven wheels, with its sensors.
///
/// Its frame has its origin on the floor between the wheels and looks ahead. A sensor with a period that is no multiple of the
/// physics step is read in the first step after it became due.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What the body covers of the floor.
    pub shape: Shape,
    /// Height of the body (m): what hangs higher does not touch it.
    pub height: f64,
    /// Colour of the body, as other robots see it.
    pub colour: Colour,
    /// Sectors of the bumper ring, 1 to 32; the first is centred straight ahead, the others follow to the left.
    pub bumper_sectors: u32,
    /// How often the bumper is told; a change is told at once.
    pub bumper_period: Duration,
    /// Wheels and motors.
    pub drive: Drive,
    /// The ring of sonars, if there is one.
    pub sonar: Option<Sonar>,
    /// The laser, if there is one.
    pub laser: Option<Laser>,
    /// What sees landmarks, if there is something.
    pub landmarks: Option<LandmarkSensor>,
    /// What hears the transmitters of landmarks, if there is something.
    pub infrared: Option<Infrared>,
    /// The gyro.
    pub gyro: Gyro,
    /// The head that carries the camera.
    pub head: Head,
    /// The camera, if there is one.
    pub camera: Option<Camera>,
    /// The battery.
    pub battery: Battery,
}

/// The outline of a body on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A disc about the point between the wheels.
    Round {
        /// Its radius (m).
        radius: f64,
    },
    /// A rectangle along the heading.
    Rectangle {
        /// From its back to its front (m).
        length: f64,
        /// From side to side (m).
        width: f64,
        /// How far its middle lies ahead of the point between the wheels (m); negative is behind.
        ahead: f64,
    },
}

impl Shape {
    /// The radius of the smallest disc about the point between the wheels that holds the whole body (m).
    pub fn reach(&self) -> f64 {
        match *self {
            Shape::Round { radius } => radius,
            Shape::Rectangle { length, width, ahead } => {
                libm::hypot(length / 2.0 + libm::fabs(ahead), width / 2.0)
            }
        }
    }

    /// The radius of the largest disc about the point between the wheels that the body holds (m).
    pub fn inner(&self) -> f64 {
        match *self {
            Shape::Round { radius } => radius,
            Shape::Rectangle { length, width, ahead } => {
                (length / 2.0 - libm::fabs(ahead)).min(width / 2.0).max(0.0)
            }
        }
    }

    /// How far the rim is from the point between the wheels in a direction to the left of ahead (m).
    pub fn rim(&self, bearing: f64) -> f64 {
        match *self {
            Shape::Round { radius } => radius,
            Shape::Rectangle { length, width, ahead } => {
                let way = Point::polar(1.0, bearing);
                // Where the ray leaves the strip between two sides; it runs along them for ever when they are parallel to it.
                let leave = |way: f64, low: f64, high: f64| {
                    if way > 0.0 {
                        high / way
                    } else if way < 0.0 {
                        low / way
                    } else {
                        f64::INFINITY
                    }
                };
                leave(way.x, ahead - length / 2.0, ahead + length / 2.0).min(leave(
                    way.y,
                    -width / 2.0,
                    width / 2.0,
                ))
            }
        }
    }

    /// The corners of the body around a pose, counter-clockwise; none of a round one.
    pub fn corners(&self, pose: Pose) -> Option<[Point; 4]> {
        match self.solid(pose) {
            Solid::Round(_) => None,
            Solid::Square(rectangle) => Some(rectangle.corners()),
        }
    }

    pub(crate) fn solid(&self, pose: Pose) -> Solid {
        match *self {
            Shape::Round { radius } => Solid::Round(Circle { centre: pose.position(), radius }),
            Shape::Rectangle { length, width, ahead } => {
                Solid::Square(Rectangle::new(pose, length, width, ahead))
            }
        }
    }
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
    /// How often the encoders are read.
    pub period: Duration,
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
    /// How often the ring fires: all cones at once. A ring of twelve that is fired in three groups at six metres takes a good
    /// 0.1 s, and 0.25 s leaves room.
    pub period: Duration,
}

/// A scanning laser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laser {
    /// Number of beams; the first looks furthest to the right. At most 4096.
    pub beams: u32,
    /// Angle between the first beam and the last (rad).
    pub field: f64,
    /// How far it sits ahead of the point between the wheels (m).
    pub x: f64,
    /// How far it sits to the left of there (m).
    pub y: f64,
    /// Where the middle of its field looks, to the left of ahead (rad).
    pub heading: f64,
    /// Height above the floor (m).
    pub height: f64,
    /// Longest range; also what is read without a return (m).
    pub max_range: f64,
    /// Standard deviation of a range (m).
    pub noise: f64,
    /// Probability that a beam does not return.
    pub dropout: f64,
    /// How often it scans.
    pub period: Duration,
}

/// A sensor that sees landmarks: from its middle it tells range and bearing of each, as what works on the pictures of a camera
/// does. It sits above the point between the wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkSensor {
    /// How wide it sees (rad).
    pub field: f64,
    /// Whether it looks where the head looks, and not always ahead.
    pub on_head: bool,
    /// Height above the floor (m): what is at least as high hides what is behind it.
    pub height: f64,
    /// Nearer landmarks are not seen (m, to the middle).
    pub min_range: f64,
    /// Landmarks further away are not seen (m, to the middle).
    pub max_range: f64,
    /// Standard deviation of a range in proportion to it.
    pub relative_noise: f64,
    /// Standard deviation at range zero (m).
    pub noise: f64,
    /// Standard deviation of a bearing (rad).
    pub bearing_noise: f64,
    /// Whether it tells which landmark it sees.
    pub identifies: bool,
    /// Probability that a landmark in view is not told.
    pub miss: f64,
    /// Probability that it is told to be another one of the world.
    pub mistake: f64,
    /// How often it looks.
    pub period: Duration,
}

/// Receivers all around for the transmitters of landmarks. They tell which landmark is heard and from which of its sides, but
/// neither how far nor where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infrared {
    /// Height above the floor (m).
    pub height: f64,
    /// Transmitters further away are not heard (m).
    pub max_range: f64,
    /// Probability that a transmitter in reach is not heard.
    pub miss: f64,
    /// How often the receivers are read.
    pub period: Duration,
}

/// A gyro about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyro {
    /// Standard deviation of the constant bias, drawn once a run (rad/s).
    pub bias: f64,
    /// Standard deviation of a reading (rad/s).
    pub noise: f64,
    /// How often it is read.
    pub period: Duration,
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
    /// How often the joints are read.
    pub period: Duration,
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
    /// How often it takes a picture.
    pub period: Duration,
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
    /// How often it is read.
    pub period: Duration,
}

/// The names of the models that there are.
pub const NAMES: [&str; 3] = ["h1", "r1", "jackal"];

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
            shape: Shape::Round { radius: 0.225 },
            height: 1.1,
            colour: Colour([150, 155, 165]),
            bumper_sectors: 12,
            bumper_period: Duration::millis(100),
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
                period: Duration::millis(20),
            },
            sonar: Some(Sonar::default()),
            laser: None,
            landmarks: None,
            infrared: None,
            gyro: Gyro { bias: 0.002, noise: 0.005, period: Duration::millis(10) },
            head: Head { max_pan: 1.4, max_tilt: 0.6, speed: 1.5, period: Duration::millis(50) },
            camera: Some(Camera::default()),
            battery: Battery {
                capacity: 120.0,
                idle: 25.0,
                drive: 60.0,
                full: 26.0,
                empty: 21.0,
                period: Duration::secs(1),
            },
        }
    }

    /// A large laboratory robot: a drum of 0.68 m diameter and 0.85 m height, with a scanner of half a turn, one beam a degree
    /// (8 m, 10 mm), sixteen sonars, and a bumper all around.
    pub fn r1() -> Model {
        let h1 = Model::h1();
        Model {
            shape: Shape::Round { radius: 0.34 },
            height: 0.85,
            bumper_sectors: 16,
            drive: Drive { wheel_radius: 0.1, axle: 0.52, ..h1.drive },
            sonar: Some(Sonar { count: 16, ..Sonar::default() }),
            camera: None,
            ..h1.with_laser(181, std::f64::consts::PI)
        }
    }

    /// A fast small outdoor robot of 0.508 m by 0.430 m, whose scanner looks over 270° forty times a second (1081 beams, 10 m).
    ///
    /// The scanner sits 65 mm behind the middle. It drives up to 2 m/s.
    pub fn jackal() -> Model {
        let h1 = Model::h1();
        Model {
            shape: Shape::Rectangle { length: 0.508, width: 0.430, ahead: 0.0 },
            height: 0.3,
            drive: Drive { wheel_radius: 0.098, axle: 0.376, max_wheel_speed: 20.4, ..h1.drive },
            sonar: None,
            laser: Some(Laser {
                beams: 1081,
                field: 1.5 * std::f64::consts::PI,
                x: -0.065,
                height: 0.25,
                max_range: 10.0,
                period: Duration::millis(25),
                ..Laser::default()
            }),
            camera: None,
            ..h1
        }
    }

    /// The model of this name, one of [`NAMES`].
    pub fn named(name: &str) -> Option<Model> {
        match name {
            "h1" => Some(Model::h1()),
            "r1" => Some(Model::r1()),
            "jackal" => Some(Model::jackal()),
            _ => None,
        }
    }

    /// Where the sonars sit on the rim and look, in the frame of the robot.
    pub fn ring(&self) -> Vec<Pose> {
        let Some(sonar) = &self.sonar else { return Vec::new() };
        let place = |which: u32| {
            let bearing = sonar.bearing(which);
            let at = Point::polar(self.shape.rim(bearing), bearing);
            Pose::new(at.x, at.y, wrap(bearing))
        };
        (0..sonar.count).map(place).collect()
    }

    /// The same robot with a laser of this many beams over this angle (rad): 10 mm of noise, 8 m.
    pub fn with_laser(mut self, beams: u32, field: f64) -> Model {
        self.laser = Some(Laser { beams, field, ..Laser::default() });
        self
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
            period: Duration::millis(250),
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
            x: 0.0,
            y: 0.0,
            heading: 0.0,
            height: 0.35,
            max_range: 8.0,
            noise: 0.01,
            dropout: 0.002,
            period: Duration::millis(100),
        }
    }
}

impl Default for LandmarkSensor {
    /// A camera that measures a tube by the distance of its two colours: 0.8 to 3 m, a few centimetres at the far end; all tubes
    /// look the same to it.
    fn default() -> LandmarkSensor {
        LandmarkSensor {
            field: 60.0f64.to_radians(),
            on_head: true,
            height: 1.0,
            min_range: 0.8,
            max_range: 3.0,
            relative_noise: 0.01,
            noise: 0.005,
            bearing_noise: 0.01,
            identifies: false,
            miss: 0.05,
            mistake: 0.0,
            period: Duration::millis(100),
        }
    }
}

impl Default for Infrared {
    /// Up to 2 m, ten times a second.
    fn default() -> Infrared {
        Infrared { height: 0.35, max_range: 2.0, miss: 0.02, period: Duration::millis(100) }
    }
}

impl Laser {
    /// Where it sits and looks, in the frame of the robot.
    pub fn mount(&self) -> Pose {
        Pose::new(self.x, self.y, self.heading)
    }
}

impl Default for Camera {
    /// A web camera at the height of a table lamp.
    fn default() -> Camera {
        Camera {
            width: 320,
            height: 240,
            field: 60.0f64.to_radians(),
            mount: 1.0,
            noise: 3.0,
            // Fifteen a second.
            period: Duration(66_666_667),
        }
    }
}
