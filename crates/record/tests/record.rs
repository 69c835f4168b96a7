//! The log as a whole: what is written is read, from whole files, cut ones and changed ones.

// Outside of a test function too, a test ends where something is wrong.
#![allow(clippy::unwrap_used)]

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use record::log::{self, Cause, ChannelId, Clock, Reader, RunInfo, Severity, Sink, Writer};
use types::header::Quality;
use types::message::{Message, describe};
use types::messages::{Battery, Gyro, Image, LaserScan, Odometry, Transforms, Twist};
use types::value::Value;
use types::{AgentId, Category, Duration, Header, Priority, Time, cdr};

/// A file in memory that can be looked at while it is written, with as much room as it is given.
#[derive(Clone)]
struct Memory {
    bytes: Arc<Mutex<Vec<u8>>>,
    room: usize,
}

impl Memory {
    fn new(room: usize) -> Memory {
        Memory { bytes: Arc::default(), room }
    }

    fn bytes(&self) -> Vec<u8> {
        self.bytes.lock().unwrap().clone()
    }
}

impl Write for Memory {
    fn write(&mut self, more: &[u8]) -> io::Result<usize> {
        let mut bytes = self.bytes.lock().unwrap();
        let n = more.len().min(self.room - bytes.len());
        bytes.extend_from_slice(&more[..n]);
        if n == 0 && !more.is_empty() { Err(io::ErrorKind::StorageFull.into()) } else { Ok(n) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for Memory {
    fn secure(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn cut(&mut self, len: u64) -> io::Result<()> {
        self.bytes.lock().unwrap().truncate(len as usize);
        Ok(())
    }
}

/// A folder of this test, taken away at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("record-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn run() -> RunInfo {
    RunInfo {
        system: "exploration".into(),
        seed: Some(7),
        clock: Clock::Simulated,
        plan: "name = \"exploration\"\n".into(),
        notes: [("agent.0".to_owned(), "sonar".to_owned())].into(),
    }
}

fn header(i: u64, time: Time) -> Header {
    Header {
        stamp: Time(time.0 - 1_000_000),
        sequence: i + (1 << 40),
        deadline: if i.is_multiple_of(2) { Time::NEVER } else { time + Duration::millis(5) },
        sender: AgentId(3),
        recipient: if i.is_multiple_of(3) { AgentId::NONE } else { AgentId(9) },
        marker: i as u32,
        category: Category::ALL[i as usize % 5],
        priority: Priority::ALL[i as usize % 4],
        quality: Quality(255 - i as u8),
    }
}

fn twist(i: u64) -> Vec<u8> {
    let mut out = cdr::Writer::new();
    Twist { linear: i as f64, angular: -0.5 }.encode(&[], Time::ZERO, &mut out);
    out.bytes().to_vec()
}

/// Message `i` of a run of 20 Hz.
fn time(i: u64) -> Time {
    Time(i as i64 * 50_000_000)
}

fn write_all(writer: &mut Writer, messages: std::ops::Range<u64>) -> Vec<ChannelId> {
    let twist_form = describe::<Twist>();
    let topics = ["/h1/drive", "/h1/offer"].map(|topic| writer.channel(topic, &twist_form).unwrap());
    for i in messages {
        writer.write(topics[i as usize % 2], &header(i, time(i)), time(i), &twist(i)).unwrap();
    }
    topics.to_vec()
}

fn written(messages: u64) -> Vec<u8> {
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    write_all(&mut writer, 0..messages);
    writer.finish().unwrap();
    memory.bytes()
}

fn reader(bytes: Vec<u8>) -> Reader {
    let len = bytes.len() as u64;
    Reader::from(Box::new(io::Cursor::new(bytes)), len, "memory").unwrap()
}

fn read(bytes: Vec<u8>) -> Vec<log::Message> {
    reader(bytes).map(Result::unwrap).collect()
}

/// Checks that the messages are the first ones of the run, each as it was written, and says how many.
fn check_prefix(messages: &[log::Message]) -> u64 {
    for (i, message) in (0..).zip(messages) {
        assert_eq!(message.channel.topic, ["/h1/drive", "/h1/offer"][i as usize % 2]);
        assert_eq!(&*message.channel.definition, "geometry_msgs/msg/Twist");
        assert_eq!(message.header, Some(header(i, time(i))));
        assert_eq!(message.time, time(i));
        assert_eq!(message.cdr, twist(i));
    }
    messages.len() as u64
}

#[test]
fn what_is_written_is_read_with_its_header() {
    let bytes = written(45);
    let mut reader = reader(bytes);
    assert_eq!(reader.run(), Some(&run()), "known before the first message");
    let messages: Vec<_> = reader.by_ref().map(Result::unwrap).collect();
    assert_eq!(check_prefix(&messages), 45);
    assert!(reader.is_whole() && reader.damage().is_empty());
    let value = messages[3].value().unwrap();
    assert_eq!(value.as_table().unwrap().at_path("linear.x").unwrap().value, Value::Float(3.0));
}

#[test]
fn the_same_messages_give_the_same_bytes() {
    assert_eq!(written(100), written(100));
    assert_ne!(written(100), written(101));
}

#[test]
fn a_file_cut_at_any_byte_gives_every_closed_chunk() {
    let bytes = written(45);
    // Chunks of half a second hold ten messages of 20 Hz; the last one holds five.
    let mut seen = Vec::new();
    for len in 8..bytes.len() {
        let mut reader = reader(bytes[..len].to_vec());
        let messages: Vec<_> = reader.by_ref().map(Result::unwrap).collect();
        let n = check_prefix(&messages);
        assert!(n.is_multiple_of(10) || n == 45, "{n} messages of {len} bytes");
        assert!(!reader.is_whole(), "{len} bytes");
        assert!(seen.last().is_none_or(|last| *last <= n), "more bytes, fewer messages");
        if seen.last() != Some(&n) {
            seen.push(n);
        }
    }
    assert_eq!(seen, [0, 10, 20, 30, 40, 45]);
}

#[test]
fn a_killed_run_keeps_all_but_its_last_half_second() {
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    write_all(&mut writer, 0..47);
    let at_the_kill = memory.bytes();
    assert_eq!(writer.tally().safe, 40);
    std::mem::forget(writer);
    assert_eq!(check_prefix(&read(at_the_kill)), 40);
}

#[test]
fn a_chunk_closes_when_time_goes_on_without_messages() {
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    write_all(&mut writer, 0..3);
    assert_eq!(read(memory.bytes()).len(), 0);
    writer.advance(Time::from_seconds(0.49)).unwrap();
    assert_eq!(read(memory.bytes()).len(), 0);
    writer.advance(Time::from_seconds(0.5)).unwrap();
    assert_eq!(check_prefix(&read(memory.bytes())), 3);
}

#[test]
fn a_full_disk_is_told_once_and_what_is_lost_is_counted() {
    let whole = written(200).len();
    let memory = Memory::new(whole / 2);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    let channel = writer.channel("/h1/drive", &describe::<Twist>()).unwrap();
    let mut told = Vec::new();
    for i in 0..200 {
        if let Err(error) = writer.write(channel, &header(i, time(i)), time(i), &twist(i)) {
            told.push(error.to_string());
        }
    }
    let tally = writer.tally();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("later messages are lost"), "{told:?}");
    let why = io::Error::from(io::ErrorKind::StorageFull).to_string();
    assert!(told[0].contains(&why), "the cause is told: {told:?}");
    assert_eq!(tally.safe + tally.lost, 200, "{tally:?}");
    assert!(tally.safe > 30 && tally.lost > 30, "{tally:?}");
    assert!(writer.channel("/other", &describe::<Twist>()).is_ok(), "the run goes on");
    assert_eq!(writer.finish().unwrap(), tally);
    let mut reader = reader(memory.bytes());
    assert_eq!(reader.by_ref().count() as u64, tally.safe);
    assert!(reader.damage().is_empty(), "the torn piece was taken back");
}

#[test]
fn a_log_that_cannot_be_made_says_so() {
    let folder = Folder::new("nowhere");
    let refused = Writer::create(folder.0.join("no/such/folder.mcap"), &run()).err().unwrap();
    assert!(matches!(refused, log::WriteError::Create { .. }), "{refused}");
    if cfg!(target_os = "linux") {
        // A device that is always full.
        let refused = Writer::create("/dev/full", &run()).err().unwrap();
        assert!(matches!(refused, log::WriteError::Ended(_)), "{refused}");
        assert!(refused.to_string().contains("No space left on device"), "{refused}");
    }
}

#[test]
fn a_camera_does_not_fill_the_memory() {
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    let channel = writer.channel("/h1/image", &describe::<Image>()).unwrap();
    for _ in 0..12 {
        writer.write(channel, &Header::default(), Time::ZERO, &vec![0; 1 << 20]).unwrap();
    }
    assert!(writer.tally().safe >= 8 && writer.tally().open <= 4, "{:?}", writer.tally());
}

#[test]
fn a_definition_is_shared_by_name_and_cannot_have_two_forms() {
    let mut writer = Writer::to(Box::new(Memory::new(usize::MAX)), &run()).unwrap();
    let a = writer.channel("/a", &describe::<Twist>()).unwrap();
    assert_eq!(writer.channel("/a", &describe::<Twist>()).unwrap(), a);
    assert_ne!(writer.channel("/b", &describe::<Twist>()).unwrap(), a);
    let mut other = describe::<Twist>();
    other.fields.pop();
    assert!(matches!(writer.channel("/c", &other), Err(log::WriteError::TwoForms(_))));
}

/// A record of a file: its code, the length of its body, the body.
fn piece(code: u8, body: &[u8]) -> Vec<u8> {
    [&[code][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

#[test]
fn the_topics_of_a_definition_hold_it_once() {
    let schema =
        piece(3, &[&1u16.to_le_bytes()[..], &text("a/msg/A"), &text("ros2msg"), &text("bool a\n")].concat());
    let topic = |id: u16| {
        let channel =
            [&id.to_le_bytes()[..], &1u16.to_le_bytes(), &text("/a"), &text("cdr"), &0u32.to_le_bytes()];
        let message = [&id.to_le_bytes()[..], &[0; 20], &[0, 1, 0, 0, 1]];
        [piece(4, &channel.concat()), piece(5, &message.concat())].concat()
    };
    let bytes = [mcap::MAGIC, &schema, &topic(1), &topic(2)].concat();
    let messages = read(bytes);
    let [one, two] = messages.as_slice() else { panic!("{messages:?}") };
    assert_ne!(one.channel.id, two.channel.id);
    assert!(std::ptr::eq(&*one.channel.definition_text, &*two.channel.definition_text));
    assert!(std::ptr::eq(one.channel.schema().unwrap(), two.channel.schema().unwrap()));
}

#[test]
fn a_chunk_that_claims_more_than_any_memory_has_is_not_unpacked() {
    let claimed = 1u64 << 40;
    let body = [&[0; 16][..], &claimed.to_le_bytes(), &[0; 4], &text("lz4"), &0u64.to_le_bytes()].concat();
    let folder = Folder::new("claims");
    let info = log::info(folder.file("a.mcap", &[mcap::MAGIC, &piece(6, &body)].concat())).unwrap();
    assert_eq!(info.damage[0].cause, Cause::TooLarge);
}

#[test]
fn the_info_tells_topics_rates_and_span() {
    let folder = Folder::new("info");
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    write_all(&mut writer, 0..41);
    writer.note(Time::from_seconds(2.5), Severity::Warning, "safety", "too near").unwrap();
    writer.finish().unwrap();
    let info = log::info(folder.file("a.mcap", &memory.bytes())).unwrap();
    assert_eq!(info.run, Some(run()));
    assert_eq!((info.profile.as_str(), info.library.as_str()), ("ros2", "sinew"));
    assert_eq!(info.messages, 42);
    assert_eq!(info.span, Some((Time::ZERO, Time::from_seconds(2.5))));
    assert!(info.whole && info.damage.is_empty());
    let topics: Vec<_> = info.topics.iter().map(|t| (t.topic.as_str(), t.messages, t.rate())).collect();
    assert_eq!(topics, [("/h1/drive", 21, Some(10.0)), ("/h1/offer", 20, Some(10.0)), ("/rosout", 1, None)]);
}

#[test]
fn a_note_is_a_ros_log_message() {
    let memory = Memory::new(usize::MAX);
    let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
    writer.note(Time(1_500_000_000), Severity::Error, "safety", "stop\0 hidden").unwrap();
    writer.finish().unwrap();
    let messages = read(memory.bytes());
    assert_eq!(messages[0].channel.topic, log::ROSOUT);
    assert_eq!(&*messages[0].channel.definition, "rcl_interfaces/msg/Log");
    let expected = "{ stamp = { sec = 1, nanosec = 500000000 }, level = 40, name = \"safety\", msg = \"stop\", file = \"\", \
                    function = \"\", line = 0 }";
    assert_eq!(messages[0].value().unwrap().to_string(), expected);
}

#[test]
fn a_lost_header_costs_no_message() {
    let folder = Folder::new("headless");
    let mut bytes = written(45);
    // The length of the header's first text, behind the magic and the header's code and length.
    bytes[mcap::MAGIC.len() + 9 + 3] = 0xff;
    let report = log::repair(folder.file("headless.mcap", &bytes), folder.0.join("whole.mcap")).unwrap();
    assert_eq!((report.messages, report.lost.len()), (45, 1));
    assert_eq!(check_prefix(&read(std::fs::read(folder.0.join("whole.mcap")).unwrap())), 45);
}

#[test]
fn a_cut_file_is_mended_and_the_loss_is_told() {
    let folder = Folder::new("repair");
    let bytes = written(45);
    // Into the chunk that holds messages 20 to 29: behind its own times.
    let len = (0..bytes.len()).find(|len| read(bytes[..*len.max(&8)].to_vec()).len() == 20).unwrap() + 400;
    let cut = folder.file("cut.mcap", &bytes[..len]);
    let whole = folder.0.join("whole.mcap");
    let report = log::repair(&cut, &whole).unwrap();
    assert_eq!(report.messages, 20);
    assert_eq!(report.span, Some((time(0), time(19))));
    assert_eq!(report.lost.len(), 1);
    assert_eq!(report.lost[0].cause, Cause::Cut);
    assert_eq!(report.lost_span(), Some((time(20), time(29))));
    assert_eq!(report.lost_messages(), None, "nobody knows what was not written");
    assert!(!report.was_whole);
    let info = log::info(&whole).unwrap();
    assert!(info.whole && info.damage.is_empty());
    assert_eq!(info.run, Some(run()));
    assert_eq!(check_prefix(&read(std::fs::read(&whole).unwrap())), 20);
    // The mended file has an index that readers of other programs use.
    let summary = mcap::Summary::read(&std::fs::read(&whole).unwrap()).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 40, "each message and its header");
    assert!(matches!(log::repair(&cut, &cut), Err(log::RepairError::InPlace(_))));
    let text = folder.file("text.txt", b"this is no log at all");
    assert!(matches!(log::repair(&text, folder.0.join("x.mcap")), Err(log::RepairError::NoLog(_))));
    assert!(matches!(Reader::open(&text), Err(log::ReadError::NoLog(_))));
}

#[test]
fn mending_a_whole_file_changes_nothing() {
    let folder = Folder::new("copy");
    let bytes = written(45);
    let copy = folder.0.join("copy.mcap");
    let report = log::repair(folder.file("a.mcap", &bytes), &copy).unwrap();
    assert!(report.was_whole);
    assert_eq!(report.messages, 45);
    assert_eq!(std::fs::read(copy).unwrap(), bytes);
}

#[test]
fn a_changed_chunk_is_passed_over_and_told() {
    let bytes = written(45);
    let second = (8..bytes.len()).find(|len| read(bytes[..*len].to_vec()).len() == 20).unwrap();
    let mut changed = bytes.clone();
    changed[second - 100] ^= 0x10;
    let mut reader = reader(changed);
    let messages: Vec<_> = reader.by_ref().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 35, "the ten of the second chunk are gone");
    assert_eq!(reader.damage().len(), 1);
    let damage = reader.damage()[0].clone();
    assert_eq!((damage.cause, damage.span), (Cause::Changed, Some((time(10), time(19)))));
    assert_eq!(damage.messages, Some(10), "the index behind the chunk tells");
    let told = format!(
        "byte {}: the bytes are not those that were written, {} bytes cannot be read",
        damage.at, damage.bytes
    );
    assert_eq!(damage.to_string(), told + " (10 messages from 0.500 s to 0.950 s)");
    assert!(reader.is_whole());

    // The checksum stands behind opcode, length, two times and a size: 9 + 24 bytes from the start of the chunk.
    let mut changed = bytes;
    let folder = Folder::new("changed");
    changed[reader.damage()[0].at as usize + 33] ^= 1;
    assert_eq!(read(changed.clone()).len(), 35, "a chunk whose checksum is wrong is not believed");
    let report = log::repair(folder.file("a.mcap", &changed), folder.0.join("b.mcap")).unwrap();
    assert_eq!((report.messages, report.lost_messages()), (35, Some(10)));
    assert_eq!(report.lost_span(), Some((time(10), time(19))));
}

#[test]
fn a_chunk_that_claims_more_memory_than_there_is_is_passed_over() {
    let bytes = written(45);
    let start = (8..bytes.len()).find(|len| read(bytes[..*len].to_vec()).len() == 10).unwrap();
    // Past the indexes of the first chunk, opcode 7, to the second one, opcode 6.
    let mut chunk = start;
    while bytes[chunk] != 6 {
        chunk += 9 + u64::from_le_bytes(bytes[chunk + 1..chunk + 9].try_into().unwrap()) as usize;
    }
    // Its size unpacked stands behind two times: 9 + 16 bytes from its start.
    let mut changed = bytes;
    changed[chunk + 25..chunk + 33].copy_from_slice(&(1u64 << 50).to_le_bytes());
    assert_eq!(read(changed).len(), 35);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_messages_come_back(
        messages in proptest::collection::vec((0..3usize, 0i64..3_000_000_000, proptest::collection::vec(any::<u8>(), 0..40), any::<u32>()), 0..60)
    ) {
        let memory = Memory::new(usize::MAX);
        let mut writer = Writer::to(Box::new(memory.clone()), &run()).unwrap();
        let channels = ["/a", "/b", "/c"].map(|topic| writer.channel(topic, &describe::<Battery>()).unwrap());
        let mut expected = Vec::new();
        for (topic, nanos, bytes, marker) in messages {
            let header = Header { marker, stamp: Time(nanos - 5), ..Header::default() };
            writer.write(channels[topic], &header, Time(nanos), &bytes).unwrap();
            expected.push((["/a", "/b", "/c"][topic].to_owned(), Time(nanos), Some(header), bytes));
        }
        writer.finish().unwrap();
        let read: Vec<_> =
            read(memory.bytes()).into_iter().map(|m| (m.channel.topic.clone(), m.time, m.header, m.cdr)).collect();
        prop_assert_eq!(read, expected);
    }

    #[test]
    fn no_change_of_a_byte_can_do_harm(at in 8usize..3000, change in 1u8..) {
        let mut bytes = written(20);
        let at = at % bytes.len();
        bytes[at] ^= change;
        if at < 8 {
            return Ok(());
        }
        // Whatever is read was written: a changed chunk is not.
        let whole = read(written(20));
        for message in read(bytes) {
            prop_assert!(whole.iter().any(|known| known.cdr == message.cdr));
        }
    }
}

/// The definitions as ROS 2 Kilted has them: taken from the PyPI package rosbags 0.11.9,
/// `get_typestore(Stores.ROS2_KILTED).generate_msgdef(name, ros_version=2)`, without the constants of BatteryState.
#[test]
fn definitions_are_those_of_ros() {
    const TIME: &str = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
    const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
    const VECTOR: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
    const POINT: &str = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";
    const QUATERNION: &str = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
    let cases: [(types::definition::Definition, &[&str]); 10] = [
        (describe::<Twist>(), &["geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n", VECTOR]),
        (
            describe::<LaserScan>(),
            &[
                "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n\
                 float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\n\
                 float32[] intensities\n",
                HEADER,
                TIME,
            ],
        ),
        (
            describe::<Image>(),
            &[
                "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n\
                 uint8[] data\n",
                HEADER,
                TIME,
            ],
        ),
        (
            describe::<Odometry>(),
            &[
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
                 geometry_msgs/TwistWithCovariance twist\n",
                HEADER,
                TIME,
                "MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n",
                "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
                POINT,
                QUATERNION,
                "MSG: geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n",
                "MSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
                VECTOR,
            ],
        ),
        (
            describe::<Transforms>(),
            &[
                "geometry_msgs/TransformStamped[] transforms\n",
                "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n\
                 geometry_msgs/Transform transform\n",
                HEADER,
                TIME,
                "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
                VECTOR,
                QUATERNION,
            ],
        ),
        (
            describe::<Gyro>(),
            &[
                "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
                 geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
                 geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
                HEADER,
                TIME,
                QUATERNION,
                VECTOR,
            ],
        ),
        (
            describe::<Battery>(),
            &[
                "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\n\
                 float32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n\
                 uint8 power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n\
                 float32[] cell_temperature\nstring location\nstring serial_number\n",
                HEADER,
                TIME,
            ],
        ),
        (
            log::rosout_log(),
            &[
                "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\n\
                 uint32 line\n",
                TIME,
            ],
        ),
        (
            record::picture::compressed_image(),
            &["std_msgs/Header header\nstring format\nuint8[] data\n", HEADER, TIME],
        ),
        // Of ours: what other programs see of it.
        (
            log::message_header(),
            &[
                "uint16 channel\nuint8 category\nuint8 priority\nuint32 marker\nuint64 sequence\nint64 stamp_nanoseconds\n\
               int64 deadline_nanoseconds\nuint32 sender\nuint32 recipient\nuint8 quality\n",
            ],
        ),
    ];
    let rule = format!("{}\n", "=".repeat(80));
    for (definition, expected) in cases {
        assert_eq!(definition.text(), expected.join(&rule), "{}", definition.name);
    }
}
