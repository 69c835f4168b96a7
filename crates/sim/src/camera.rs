//! The picture that a robot's camera takes: a pinhole view, drawn column by column.
//!
//! With the direction of a column given as forward + right · u / f (u pixels from the middle, f the focal length in
//! pixels), the parameter of a ray is the depth along the optical axis, and a point of height z at depth t is seen in
//! row  c + f (h − z) / t,  where h is the height of the camera and c the row of the horizon. A nod moves the horizon by
//! f tan(tilt) and bends nothing; that is exact in the middle row and good for small nods.
//!
//! What a column meets becomes spans of one colour, drawn from far to near.

use libm::{cos, round, sin, sqrt, tan};
use types::Point;

use crate::colour::Colour;
use crate::field::Field;
use crate::hand::{MOST_ADDED, Standing};
use crate::model::Camera;
use crate::outline::{Look, UNSEEN};
use crate::plan::{Person, Thing};
use crate::robot::Robot;
use crate::shape::Circle;
use crate::simulator::{RobotId, Simulator};
use crate::solid::Solid;
use types::chance::Stream;

/// Nothing beyond this depth is drawn (m).
const FAR: f64 = 40.0;
/// At this distance the light has faded to half (m).
const HALF_LIGHT: f64 = 16.0;
/// Spans of one column; what is more is left out, the furthest first met stays.
const SPANS: usize = 48;
/// Length of the noise table, and the part of it in which the rows begin.
const NOISE: usize = 2048 * 3 + NOISE_STARTS;
const NOISE_STARTS: usize = 4096;
/// The unit of the noise table: a deviation of 1 is 16, and four deviations are the most.
const NOISE_UNIT: f64 = 16.0;

/// How a camera sees: what is needed to go from a pixel to a direction and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal length (pixels).
    pub focal: f64,
    /// Column of the optical axis.
    pub middle: f64,
    /// Row of the horizon.
    pub horizon: f64,
    /// Height of the camera (m).
    pub mount: f64,
}

impl Pinhole {
    /// The view of a camera whose head is nodded by `tilt` (rad, up positive).
    pub fn new(camera: &Camera, tilt: f64) -> Pinhole {
        let middle = f64::from(camera.width) / 2.0;
        let focal = middle / tan(camera.field / 2.0);
        let horizon = f64::from(camera.height) / 2.0 + focal * tan(tilt);
        Pinhole { focal, middle, horizon, mount: camera.mount }
    }

    /// The row at which a point of height `z` (m) at depth `t` (m) is seen.
    #[inline]
    pub fn row(&self, z: f64, t: f64) -> f64 {
        self.horizon + self.focal * (self.mount - z) / t
    }
}

/// Normal numbers in a table: drawing them pixel by pixel would cost more than the picture.
#[derive(Clone, Debug)]
pub(crate) struct NoiseTable(Vec<i8>);

impl NoiseTable {
    pub(crate) fn new(seed: u64) -> NoiseTable {
        let stream = Stream::new(seed, "camera noise");
        NoiseTable(
            (0..NOISE as u64).map(|k| round(stream.normal(k).clamp(-4.0, 4.0) * NOISE_UNIT) as i8).collect(),
        )
    }

    /// Adds noise of this deviation (levels) to the rows of an image.
    fn add(&self, deviation: f64, draw: Stream, image: &mut [u8], stride: usize) {
        let length = stride + NOISE_STARTS;
        // Saturating additions and subtractions of bytes are what processors do sixteen at a time.
        let mut plus = [0u8; NOISE];
        let mut minus = [0u8; NOISE];
        let scale = round(deviation / NOISE_UNIT * 256.0) as i32;
        for k in 0..length.min(NOISE) {
            let level = (i32::from(self.0[k]) * scale + 128) >> 8;
            plus[k] = level.clamp(0, 255) as u8;
            minus[k] = (-level).clamp(0, 255) as u8;
        }
        for (y, row) in image.chunks_exact_mut(stride).enumerate() {
            let from = draw.index(y as u64, NOISE_STARTS);
            for ((pixel, &up), &down) in row.iter_mut().zip(&plus[from..]).zip(&minus[from..]) {
                *pixel = pixel.saturating_add(up).saturating_sub(down);
            }
        }
    }
}

/// A piece of one column in one colour.
#[derive(Clone, Copy)]
struct Span {
    /// Depth by which spans are ordered (m).
    depth: f64,
    top: i32,
    bottom: i32,
    colour: u32,
}

const NO_SPAN: Span = Span { depth: 0.0, top: 0, bottom: 0, colour: 0 };

/// The spans of one column.
struct Column {
    spans: [Span; SPANS],
    count: usize,
    /// Length of the direction vector: distance a unit of depth.
    stretch: f64,
    view: Pinhole,
    rows: i32,
    light: f64,
}

impl Column {
    /// Strength of the light at depth `t`.
    #[inline]
    fn light_at(&self, t: f64) -> f64 {
        self.light * HALF_LIGHT / (HALF_LIGHT + t * self.stretch)
    }

    #[inline]
    fn push_rows(&mut self, depth: f64, top: f64, bottom: f64, colour: [u8; 3]) {
        // A pixel belongs to what covers its middle. Above zero, cutting off rounds down, and costs one instruction.
        let edge = |row: f64| (row.clamp(0.0, 4096.0) + 0.5) as i32;
        let (top, bottom) = (edge(top), edge(bottom).min(self.rows));
        if top < bottom && self.count < SPANS {
            self.spans[self.count] = Span { depth, top, bottom, colour: packed(colour) };
            self.count += 1;
        }
    }

    /// An upright piece at depth `t` between two heights.
    #[inline]
    fn upright(&mut self, t: f64, low: f64, high: f64, colour: Colour, shade: f64) {
        let light = self.light_at(t) * shade;
        self.push_rows(t, self.view.row(high, t), self.view.row(low, t), colour.lit(light as f32));
    }

    /// A level piece at one height from depth `near` to `far`, seen from above.
    #[inline]
    fn level(&mut self, near: f64, far: f64, height: f64, colour: Colour) {
        if self.view.mount > height {
            let light = self.light_at((near + far) / 2.0) * 1.02;
            // Ordered by its far end: what stands on it comes after it.
            self.push_rows(
                far,
                self.view.row(height, far),
                self.view.row(height, near),
                colour.lit(light as f32),
            );
        }
    }

    /// Draws the spans from far to near into one column of pixels.
    fn draw(&mut self, pixels: &mut [u32]) {
        let spans = &mut self.spans[..self.count];
        // Stable, so that what was pushed later lies in front at equal depth; few, so by insertion.
        for k in 1..spans.len() {
            let mut j = k;
            while j > 0 && spans[j - 1].depth < spans[j].depth {
                spans.swap(j - 1, j);
                j -= 1;
            }
        }
        for span in spans.iter() {
            pixels[span.top as usize..span.bottom as usize].fill(span.colour);
        }
        self.count = 0;
    }
}

/// Columns are drawn this many at a time, each in one piece, and then written row by row: two words a row.
const TILE: usize = 4;

/// A colour in one word, red lowest.
#[inline]
fn packed(colour: [u8; 3]) -> u32 {
    u32::from_le_bytes([colour[0], colour[1], colour[2], 0])
}

/// Writes the columns of a tile, one after another in `tile`, to the image from byte `from` of each row on.
///
/// Two pixels are written as a word of eight bytes, of which six are theirs: up to two bytes of the next tile are spoilt, so
/// tiles are written from left to right.
fn write_tile(tile: &[u32], image: &mut [u8], stride: usize, from: usize) {
    let (ab, cd) = tile.split_at(tile.len() / 2);
    let ((a, b), (c, d)) = (ab.split_at(ab.len() / 2), cd.split_at(cd.len() / 2));
    let pair = |left: u32, right: u32| (u64::from(left) | u64::from(right) << 24).to_le_bytes();
    let columns = a.iter().zip(b).zip(c).zip(d);
    for (row, (((a, b), c), d)) in image.chunks_exact_mut(stride).zip(columns) {
        let (left, right) = (pair(*a, *b), pair(*c, *d));
        let place = &mut row[from..];
        if let Some(place) = place.first_chunk_mut::<{ 3 * TILE + 2 }>() {
            place[..8].copy_from_slice(&left);
            place[6..].copy_from_slice(&right);
        } else {
            // The last columns end with the row.
            let bytes = left[..6].iter().chain(&right[..6]);
            place.iter_mut().zip(bytes).for_each(|(out, byte)| *out = *byte);
        }
    }
}

/// Something upright and round that is not part of the walls: whose it is, by its place in the world.
#[derive(Clone, Copy, Debug)]
enum Sprite {
    Person(usize),
    Robot(usize),
    Thing(usize),
    /// What a person carries, and where.
    Carried(usize, Point),
    /// What was added to the running world.
    Added(usize),
}

/// The memory in which pictures are made. It is kept from one picture to the next, so that no picture asks for more.
#[derive(Clone, Debug, Default)]
pub struct Canvas {
    /// Floor and ceiling: a column of pixels.
    background: Vec<u32>,
    tile: Vec<u32>,
    sprites: Vec<Sprite>,
}

impl Simulator {
    /// The memory for all pictures of a robot.
    pub fn canvas(&self, id: RobotId) -> Canvas {
        let rows = self.robots[id.index()].model.camera.as_ref().map_or(0, |camera| camera.height as usize);
        // Who carries something is two of them.
        let sprites = 2 * self.people.len() + self.robots.len() + self.plan.things.len() + MOST_ADDED;
        Canvas {
            background: Vec::with_capacity(rows),
            tile: Vec::with_capacity(TILE * rows),
            sprites: Vec::with_capacity(sprites),
        }
    }

    /// Takes the picture of a robot's camera: red, green and blue bytes, row by row from the top.
    ///
    /// Gives its width and height; nothing when the robot has no camera or `image` is not width × height × 3 bytes long. The
    /// `canvas` may come from any other picture.
    pub fn render(
        &self,
        id: RobotId,
        sample: u64,
        canvas: &mut Canvas,
        image: &mut [u8],
    ) -> Option<(u32, u32)> {
        let robot = &self.robots[id.index()];
        let camera = robot.model.camera.as_ref()?;
        let stride = camera.width as usize * 3;
        if image.len() != stride * camera.height as usize {
            return None;
        }
        self.draw_view(camera, robot, canvas, image);
        if camera.noise > 0.0 {
            self.noise.add(camera.noise, robot.streams.camera.sample(sample), image, stride);
        }
        Some((camera.width, camera.height))
    }

    fn draw_view(&self, camera: &Camera, robot: &Robot, canvas: &mut Canvas, image: &mut [u8]) {
        let stride = camera.width as usize * 3;
        let view = Pinhole::new(camera, robot.head.tilt);
        let light = self.plan.light;
        let eye = robot.truth.pose.position();
        let yaw = robot.truth.pose.heading + robot.head.pan;
        let forward = Point::new(cos(yaw), sin(yaw));
        let right = Point::new(forward.y, -forward.x);
        let Canvas { background, tile, sprites } = canvas;
        self.floor_and_ceiling(view, light, camera.height, background);
        self.find_sprites(eye, forward, robot.body, sprites);
        let rows = background.len();
        tile.resize(TILE * rows, 0);
        let mut column = Column {
            spans: [NO_SPAN; SPANS],
            count: 0,
            stretch: 1.0,
            view,
            rows: camera.height as i32,
            light,
        };
        for x in 0..camera.width as usize {
            let u = (x as f64 + 0.5 - view.middle) / view.focal;
            let ray = forward + right * u;
            column.stretch = sqrt(1.0 + u * u);
            walls(&self.field, &self.looks, self.plan.ceiling_height, eye, ray, &mut column);
            for sprite in sprites.iter() {
                sprite.draw(self, eye, ray, &mut column);
            }
            let pixels = &mut tile[x % TILE * rows..(x % TILE + 1) * rows];
            pixels.copy_from_slice(background);
            column.draw(pixels);
            if x % TILE == TILE - 1 || x + 1 == camera.width as usize {
                write_tile(tile, image, stride, x / TILE * TILE * 3);
            }
        }
    }

    /// Floor and ceiling: a column of pixels.
    fn floor_and_ceiling(&self, view: Pinhole, light: f64, rows: u32, column: &mut Vec<u32>) {
        let row = |y: u32| {
            let slope = (view.horizon - (f64::from(y) + 0.5)) / view.focal;
            let (colour, height) = if slope > 0.0 {
                (self.plan.ceiling, self.plan.ceiling_height - view.mount)
            } else {
                (self.plan.floor, view.mount)
            };
            let depth = (height / slope.abs().max(1e-6)).clamp(0.0, 1000.0);
            packed(colour.lit((light * HALF_LIGHT / (HALF_LIGHT + depth)) as f32))
        };
        column.clear();
        column.extend((0..rows).map(row));
    }

    /// What moves or is round and may be in the picture.
    fn find_sprites(&self, eye: Point, forward: Point, own: u32, sprites: &mut Vec<Sprite>) {
        let ahead = |at: Point, radius: f64| {
            let to = at - eye;
            let depth = to.dot(forward);
            depth > -radius && depth < FAR && libm::fabs(to.cross(forward)) < FAR
        };
        sprites.clear();
        for (k, walker) in self.people.iter().enumerate() {
            if walker.present && ahead(walker.at, 1.0) {
                sprites.push(Sprite::Person(k));
                sprites.extend(walker.hands().map(|at| Sprite::Carried(k, at)));
            }
        }
        let robots = self.robots.iter().enumerate().filter(|(_, robot)| robot.body != own);
        let robots = robots.filter(|(_, robot)| ahead(robot.truth.pose.position(), 1.0));
        sprites.extend(robots.map(|(k, _)| Sprite::Robot(k)));
        let things = self.plan.things.iter().enumerate().filter(|(_, thing)| ahead(thing.at, thing.radius));
        sprites.extend(things.map(|(k, _)| Sprite::Thing(k)));
        let added = self.added().iter().enumerate().filter_map(|(k, thing)| Some((k, thing.as_ref()?)));
        let added = added.filter(|(_, thing)| ahead(thing.pose.position(), thing.shape.reach()));
        sprites.extend(added.map(|(k, _)| Sprite::Added(k)));
    }
}

/// The spans of everything that stands still along one ray.
fn walls(field: &Field, looks: &[Look], ceiling: f64, eye: Point, ray: Point, column: &mut Column) {
    let mut tops = Tops { entries: [NO_TOP; 16], count: 0 };
    let mut done = f64::NEG_INFINITY;
    let mut blocked = FAR;
    field.walk(eye, ray, FAR, |cell, out| {
        if field.has_static(cell) {
            for &index in field.faces_of(cell) {
                let face = &field.faces[index as usize];
                // A face lies in several cells; it is taken in the one in which it is met.
                let Some(t) = face.segment.meet(eye, ray, out.min(blocked) + 1e-9) else { continue };
                if t <= done || t < 1e-3 {
                    continue;
                }
                let look = &looks[face.look as usize];
                let slant = ray.dot(face.segment.normal);
                let top =
                    (look.body != 0 && face.high < column.view.mount).then(|| tops.of(look.body)).flatten();
                if let Some(top) = top {
                    (top.height, top.colour) = (face.high, look.top);
                    if slant > 0.0 { top.far = t } else { top.near = t }
                }
                if look.body != 0 && slant > 0.0 {
                    continue;
                }
                let shade = face_shade(face.segment.normal, eye + ray * t);
                let shade = if look.skirting { shade.0 * shade.1 } else { shade.0 };
                column.upright(t, face.low, face.high, look.colour, shade);
                if look.skirting {
                    column.upright(t, 0.0, 0.09, Colour([92, 84, 76]), shade);
                }
                if face.low <= 0.0 && face.high >= ceiling - 1e-9 {
                    blocked = blocked.min(t);
                }
            }
            for &index in field.posts_of(cell) {
                let post = &field.posts[index as usize];
                if post.look != UNSEEN
                    && let Some((t, far, shade)) = cylinder(post.circle, eye, ray)
                    && t > done
                    && t <= out
                    && t < blocked
                {
                    let look = &looks[post.look as usize];
                    column.level(t, far, post.high, look.top);
                    column.upright(t, post.low, post.high, look.colour, shade);
                }
            }
        }
        done = out;
        blocked <= out
    });
    for top in &tops.entries[..tops.count] {
        // A far side that was not met stands in or behind the wall that ended the view.
        if top.near <= blocked {
            column.level(top.near, top.far.min(blocked).max(top.near), top.height, top.colour);
        }
    }
}

/// The upper sides of boxes along a ray: where it enters and leaves each.
struct Tops {
    entries: [Top; 16],
    count: usize,
}

#[derive(Clone, Copy)]
struct Top {
    body: u32,
    near: f64,
    far: f64,
    height: f64,
    colour: Colour,
}

const NO_TOP: Top =
    Top { body: 0, near: f64::INFINITY, far: f64::INFINITY, height: 0.0, colour: Colour([0; 3]) };

impl Tops {
    /// The entry of a body, made when it is new; nothing when there is no room for more.
    fn of(&mut self, body: u32) -> Option<&mut Top> {
        if let Some(k) = self.entries[..self.count].iter().position(|top| top.body == body) {
            return Some(&mut self.entries[k]);
        }
        let top = self.entries.get_mut(self.count)?;
        *top = Top { body, ..NO_TOP };
        self.count += 1;
        Some(top)
    }
}

/// Shade of a face by its direction, and of the seams between its boards by the place.
fn face_shade(normal: Point, at: Point) -> (f64, f64) {
    const BOARD: f64 = 1.2;
    let along = (at.y * normal.x - at.x * normal.y) / BOARD;
    // Cutting off is enough for a pattern, and far cheaper than rounding down.
    let part = libm::fabs(along - along as i64 as f64);
    let seam = if part < 0.012 { 0.86 } else { 1.0 };
    (0.86 + 0.16 * normal.x * normal.x + 0.03 * normal.y, seam)
}

/// Where a ray enters and leaves a round thing, and how that place is lit.
fn cylinder(circle: Circle, eye: Point, ray: Point) -> Option<(f64, f64, f64)> {
    let near = circle.meet(eye, ray, FAR)?;
    if near < 1e-3 {
        return None;
    }
    let a = ray.dot(ray);
    let far = 2.0 * (circle.centre - eye).dot(ray) / a - near;
    let out = (eye + ray * near - circle.centre) * (1.0 / circle.radius);
    let facing = -out.dot(ray) / sqrt(a);
    Some((near, far, 0.62 + 0.38 * facing))
}

impl Sprite {
    fn draw(self, world: &Simulator, eye: Point, ray: Point, column: &mut Column) {
        match self {
            Sprite::Person(k) => {
                let walker = &world.people[k];
                person(&walker.plan, walker.at, walker.facing, eye, ray, column);
            }
            Sprite::Robot(k) => machine(&world.robots[k], eye, ray, column),
            Sprite::Added(k) => {
                if let Some(thing) = world.added.get(k) {
                    plain(thing, eye, ray, column);
                }
            }
            Sprite::Thing(k) => ball(&world.plan.things[k], world.plan.things[k].at, eye, ray, column),
            Sprite::Carried(k, at) => {
                if let Some(thing) = &world.people[k].plan.carries {
                    ball(thing, at, eye, ray, column);
                }
            }
        }
    }
}

/// A person: trousers, shirt, and a head with hair.
fn person(plan: &Person, at: Point, facing: f64, eye: Point, ray: Point, column: &mut Column) {
    let Some((t, _, shade)) = cylinder(Circle { centre: at, radius: plan.radius }, eye, ray) else { return };
    let tall = plan.height;
    let aside = (at - eye).cross(ray) / column.stretch / plan.radius;
    let side = libm::fabs(aside);
    // Between the legs one sees through; the arms hang beside the trunk.
    if side < 0.8 {
        let low = if side < 0.07 { 0.40 * tall } else { 0.03 * tall };
        column.upright(t, low, 0.49 * tall, plan.trousers, shade);
        if side >= 0.07 {
            column.upright(t, 0.0, 0.035 * tall, Colour([36, 32, 30]), shade);
        }
    } else {
        column.upright(t, 0.42 * tall, 0.47 * tall, SKIN, shade);
    }
    let shoulder = 0.83 - 0.05 * side * side;
    column.upright(
        t,
        0.47 * tall,
        shoulder * tall,
        plan.shirt,
        if side > 0.78 { shade * 0.85 } else { shade },
    );
    if side < 0.25 {
        column.upright(t, 0.81 * tall, 0.87 * tall, SKIN, shade * 0.9);
    }
    let radius = 0.068 * tall;
    let hair = Colour([66, 50, 38]);
    if let Some((top, bottom, depth, lit)) = ball_rows(at, 0.925 * tall, radius, eye, ray, column) {
        let looks_here = Point::polar(1.0, facing).dot(ray) < 0.0;
        let line = if looks_here { top + (bottom - top) * 0.34 } else { top + (bottom - top) * 0.8 };
        let light = column.light_at(depth) * lit;
        column.push_rows(t - 1e-6, top, line, hair.lit(light as f32));
        column.push_rows(t - 1e-6, line, bottom, SKIN.lit(light as f32));
    }
}

const SKIN: Colour = Colour([206, 164, 122]);

/// A plain box or cylinder.
fn plain(thing: &Standing, eye: Point, ray: Point, column: &mut Column) {
    if let Some((t, far, shade)) = trunk(thing.shape.solid(thing.pose), eye, ray) {
        column.level(t, far, thing.height, thing.colour);
        column.upright(t, 0.0, thing.height, thing.colour, shade);
    }
}

/// Where a ray enters and leaves an upright body, and how the side is lit by which it enters.
fn trunk(solid: Solid, eye: Point, ray: Point) -> Option<(f64, f64, f64)> {
    match solid {
        Solid::Round(circle) => cylinder(circle, eye, ray),
        Solid::Square(rectangle) => {
            let (near, far, normal) = rectangle.through(eye, ray)?;
            Some((near, far, face_shade(normal, eye + ray * near).0))
        }
    }
}

/// Another robot: a body with a dark base and a dark ring of sensors, and a head.
fn machine(robot: &Robot, eye: Point, ray: Point, column: &mut Column) {
    let (at, tall) = (robot.truth.pose.position(), robot.model.height);
    let dark = Colour([48, 50, 54]);
    let body = robot.model.shape.solid(robot.truth.pose);
    if let Some((t, far, shade)) = trunk(body, eye, ray) {
        let trunk = 0.62 * tall;
        column.level(t, far, trunk, robot.model.colour);
        column.upright(t, 0.02, 0.1 * tall, dark, shade);
        column.upright(t, 0.1 * tall, trunk, robot.model.colour, shade);
        column.upright(t, 0.29 * tall, 0.34 * tall, dark, shade);
    }
    let neck = Circle { centre: at, radius: 0.2 * robot.model.shape.inner() };
    if let Some((t, _, shade)) = cylinder(neck, eye, ray) {
        column.upright(t, 0.62 * tall, 0.86 * tall, dark, shade);
    }
    let head = Circle { centre: at, radius: 0.45 * robot.model.shape.inner() };
    if let Some((t, _, shade)) = cylinder(head, eye, ray) {
        column.upright(t, 0.86 * tall, tall, robot.model.colour, shade);
    }
}

/// A ball in three bands of light.
fn ball(thing: &Thing, at: Point, eye: Point, ray: Point, column: &mut Column) {
    let &Thing { height, radius, colour, .. } = thing;
    let Some((top, bottom, depth, lit)) = ball_rows(at, height, radius, eye, ray, column) else { return };
    let light = column.light_at(depth) * lit;
    let row = |part: f64| top + (bottom - top) * part;
    for (from, to, shade) in [(0.0, 0.35, 1.12), (0.35, 0.75, 1.0), (0.75, 1.0, 0.78)] {
        column.push_rows(depth, row(from), row(to), colour.lit((light * shade) as f32));
    }
}

/// The rows between which a column sees a ball, its depth there, and how that slice is lit.
///
/// The plane of the column cuts the ball in a circle; the rows are those of the two tangents to it.
fn ball_rows(
    at: Point,
    height: f64,
    radius: f64,
    eye: Point,
    ray: Point,
    column: &Column,
) -> Option<(f64, f64, f64, f64)> {
    let to = at - eye;
    let along = to.dot(ray) / column.stretch;
    let aside = to.cross(ray) / column.stretch;
    let slice2 = radius * radius - aside * aside;
    if slice2 <= 0.0 || along * along <= slice2 || along <= 0.0 {
        return None;
    }
    let rise = height - column.view.mount;
    let out2 = along * along + rise * rise - slice2;
    if out2 <= 0.0 {
        return None;
    }
    let slice = sqrt(slice2);
    let bottom = along * along - slice2;
    let tangent = |sign: f64| (along * rise + sign * slice * sqrt(out2)) / bottom;
    let row = |slope: f64| column.view.horizon - column.view.focal * column.stretch * slope;
    let depth = (along - slice) / column.stretch;
    Some((row(tangent(1.0)), row(tangent(-1.0)), depth, 0.75 + 0.25 * slice / radius))
}
