//! Where things are.

use alloc::vec::Vec;

use libm::{cos, sin};

use super::Twist;
use crate::cdr::{Element, Error, Field, NoElement, Reader, Writer};
use crate::definition::{Definition, Kind};
use crate::geometry::{Pose, wrap};
use crate::message::{Message, ros};
use crate::text::Name;
use crate::time::{Duration, Time};

/// Where a robot believes to be and how it moves; to ROS 2 a `nav_msgs/Odometry`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Odometry {
    /// The frame of the pose.
    pub frame: Name,
    /// The frame of the body.
    pub body: Name,
    /// `frame_from_body`.
    pub pose: Pose,
    /// In the body's frame.
    pub twist: Twist,
}

fn write_planar_pose(pose: Pose, out: &mut Writer) {
    out.put(pose.x).put(pose.y).put(0f64);
    write_planar_rotation(pose.heading, out);
}

fn write_planar_rotation(heading: f64, out: &mut Writer) {
    out.put(0f64).put(0f64).put(sin(heading / 2.0)).put(cos(heading / 2.0));
}

fn read_planar_pose(input: &mut Reader<'_>) -> Result<Pose, Error> {
    let (x, y) = (input.get()?, input.get()?);
    input.skip_f64(1 + 2)?;
    let (z, w): (f64, f64) = (input.get()?, input.get()?);
    Ok(Pose { x, y, heading: wrap(2.0 * libm::atan2(z, w)) })
}

impl Message for Odometry {
    type Element = NoElement;
    const NAME: &'static str = "nav_msgs/msg/Odometry";

    fn definition() -> Definition {
        let pose = Definition::new(
            "geometry_msgs/msg/Pose",
            [("position", Kind::Struct(ros::point())), ("orientation", Kind::Struct(ros::quaternion()))],
        );
        let covariance = || ("covariance", Kind::Array(Kind::F64.into(), 36));
        let pose = Definition::new(
            "geometry_msgs/msg/PoseWithCovariance",
            [("pose", Kind::Struct(pose)), covariance()],
        );
        let twist = Definition::new(
            "geometry_msgs/msg/TwistWithCovariance",
            [("twist", Twist::kind()), covariance()],
        );
        Definition::new(
            Self::NAME,
            [
                ("header", Kind::Struct(ros::header())),
                ("child_frame_id", Kind::String),
                ("pose", Kind::Struct(pose)),
                ("twist", Kind::Struct(twist)),
            ],
        )
    }

    fn encode(&self, _: &[NoElement], stamp: Time, out: &mut Writer) {
        out.header(stamp, self.frame.as_str());
        out.text(self.body.as_str());
        write_planar_pose(self.pose, out);
        out.zeros_f64(36);
        Twist::write(self.twist, out);
        out.zeros_f64(36);
    }

    fn decode(input: &mut Reader<'_>, _: &mut Vec<NoElement>) -> Result<Odometry, Error> {
        let (_, frame) = input.header()?;
        let frame = Name::new(frame);
        let body = Name::new(input.text()?);
        let pose = read_planar_pose(input)?;
        input.skip_f64(36)?;
        let twist = Twist::read(input)?;
        input.skip_f64(36)?;
        Ok(Odometry { frame, body, pose, twist })
    }

    fn disturb(&mut self, _: &mut [NoElement], wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.pose.x.disturb(wild, draw);
        self.pose.y.disturb(wild, draw);
        self.pose.heading.disturb(wild, draw);
    }

    /// Along the straight line, the heading by the shorter way.
    fn between(earlier: &Odometry, later: &Odometry, ratio: f64) -> Option<Odometry> {
        let mix = |a: f64, b: f64| a + (b - a) * ratio;
        let (a, b) = (earlier.pose, later.pose);
        let turn = wrap(b.heading - a.heading);
        let pose = Pose { x: mix(a.x, b.x), y: mix(a.y, b.y), heading: wrap(a.heading + turn * ratio) };
        Some(Odometry { pose, twist: Twist::between(&earlier.twist, &later.twist, ratio)?, ..*later })
    }

    /// Along the arc of the last velocity.
    fn beyond(last: &Odometry, span: Duration) -> Option<Odometry> {
        Some(Odometry {
            pose: last.pose.advanced(last.twist.linear, last.twist.angular, span.seconds()),
            ..*last
        })
    }
}

/// Where one frame is in another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct FrameTransform {
    /// The frame in which it is given.
    pub parent: Name,
    /// The frame whose place it is.
    pub child: Name,
    /// `parent_from_child` in the plane.
    pub pose: Pose,
    /// Height of the child above the parent (m).
    pub z: f64,
}

impl FrameTransform {
    fn definition() -> Definition {
        let transform = Definition::new(
            "geometry_msgs/msg/Transform",
            [("translation", Kind::Struct(ros::vector())), ("rotation", Kind::Struct(ros::quaternion()))],
        );
        Definition::new(
            "geometry_msgs/msg/TransformStamped",
            [
                ("header", Kind::Struct(ros::header())),
                ("child_frame_id", Kind::String),
                ("transform", Kind::Struct(transform)),
            ],
        )
    }

    fn write_at(&self, stamp: Time, out: &mut Writer) {
        out.header(stamp, self.parent.as_str());
        out.text(self.child.as_str());
        out.put(self.pose.x).put(self.pose.y).put(self.z);
        write_planar_rotation(self.pose.heading, out);
    }
}

impl Field for FrameTransform {
    fn kind() -> Kind {
        Kind::Struct(FrameTransform::definition())
    }

    fn write(&self, out: &mut Writer) {
        self.write_at(Time::ZERO, out);
    }

    fn read(input: &mut Reader<'_>) -> Result<FrameTransform, Error> {
        let (_, parent) = input.header()?;
        let parent = Name::new(parent);
        let child = Name::new(input.text()?);
        let (x, y, z): (f64, f64, f64) = (input.get()?, input.get()?, input.get()?);
        input.skip_f64(2)?;
        let (qz, qw): (f64, f64) = (input.get()?, input.get()?);
        let pose = Pose { x, y, heading: wrap(2.0 * libm::atan2(qz, qw)) };
        Ok(FrameTransform { parent, child, pose, z })
    }
}

impl Element for FrameTransform {}

/// A part of the frame tree: its edges are the row behind it; to ROS 2 a `tf2_msgs/TFMessage`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transforms;

impl Message for Transforms {
    type Element = FrameTransform;
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";

    fn definition() -> Definition {
        Definition::new(Self::NAME, [("transforms", Kind::Sequence(FrameTransform::kind().into()))])
    }

    fn encode(&self, edges: &[FrameTransform], stamp: Time, out: &mut Writer) {
        out.put(edges.len() as u32);
        edges.iter().for_each(|edge| edge.write_at(stamp, out));
    }

    fn decode(input: &mut Reader<'_>, edges: &mut Vec<FrameTransform>) -> Result<Transforms, Error> {
        for _ in 0..input.len(1)? {
            edges.push(input.get()?);
        }
        Ok(Transforms)
    }
}
