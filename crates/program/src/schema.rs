//! The JSON schema of system files, for editors: the agent types of this program with their parameters, docs and ranges.

use runtime::{AgentType, Direction, ExecutorPlan, Overload, Policy, PortInfo, Registry};
use serde_json::{Map, Value as Json, json};
use types::params::ParamField;
use types::value::{Table, Value};
use types::{Category, Priority};

use crate::file::{SECTIONS, Shelf};

/// The schema of system files (JSON Schema, draft 2020-12). Agents are told apart by their `is`; their inputs, parameters and
/// ranges are those of the registry.
///
/// Names that a file makes itself (ports of its agents, executors) are checked by form only: `sinew check` does the rest.
pub fn schema(registry: &Registry) -> Json {
    let kinds = registry.types().iter().filter(|kind| kind.kind != "robot");
    let mut agents: Vec<Json> = kinds.map(agent).collect();
    agents.push(group());
    let [
        name,
        world,
        processors_,
        as_declared_,
        robot_,
        executor_,
        agent_,
        queue_,
        wires_,
        decide_,
        knowledge_,
        goal_,
        vary_,
        burden_,
        compare_,
        at_,
        figure_,
        for_,
    ] = SECTIONS;
    let properties = object([
        (name, json!({"type": "string", "description": "The name of the system."})),
        (world, world_()),
        (
            processors_,
            json!({"type": "integer", "minimum": 1, "maximum": 64, "description":
                "In simulated time, on how many virtual processors steps take the cost that they declare."}),
        ),
        (
            as_declared_,
            flag(
                "On the wall clock, too, lets steps take the cost that they declare: they work on until then.",
            ),
        ),
        (robot_, named(robot(registry.get("robot")), "The robots.")),
        (executor_, named(executor(), "Threads besides the usual ones, or in their place.")),
        (agent_, named(json!({"anyOf": agents}), "The agents.")),
        (queue_, named(queue(), "Mailboxes that several inputs share.")),
        (wires_, wires()),
        (decide_, decide()),
        (knowledge_, knowledge()),
        (goal_, goal()),
        (
            vary_,
            json!({"type": "object", "description": "What a seed draws: an entry and its distribution."}),
        ),
        (burden_, named(burden(), "Work of other processes with a real-time priority.")),
        (
            compare_,
            json!({"type": "object", "minProperties": 1, "maxProperties": 1,
                "additionalProperties": {"type": "array", "minItems": 2},
                "description": "An entry of the plan with several values, whose runs are shown one above the other."}),
        ),
        (at_, json!({"type": "array", "items": request(), "description": "Timed requests and faults."})),
        (for_, time("How long a run lasts in simulated time, where there is no goal.")),
        (
            figure_,
            json!({"type": "array", "items": figure(), "description": "Parts of the run that are drawn by themselves."}),
        ),
    ]);
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A system file",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "$defs": {
            "time": {
                "type": "string",
                "pattern": "^\\s*[-+0-9.eE]+\\s*(ns|us|ms|s|min|h)$",
                "description": "A time: a number and one of ns, us, ms, s, min, h."
            },
            "port": {"type": "string", "pattern": "^.+$", "description": "An agent and its port, as in sonar.filtered, or a queue."},
        },
    })
}

/// A value of a file as JSON, which the schema can be held against.
pub fn json_of(value: &Value) -> Json {
    match value {
        Value::Bool(b) => json!(b),
        Value::Int(n) => json!(n),
        Value::Float(x) => json!(x),
        Value::Text(text) => json!(text),
        Value::List(list) => list.iter().map(|entry| json_of(&entry.value)).collect(),
        Value::Table(table) => json_of_table(table),
    }
}

fn json_of_table(table: &Table) -> Json {
    Json::Object(table.rows().iter().map(|row| (row.key.clone(), json_of(&row.entry.value))).collect())
}

fn object<'a>(rows: impl IntoIterator<Item = (&'a str, Json)>) -> Json {
    Json::Object(rows.into_iter().map(|(key, value)| (key.to_owned(), value)).collect::<Map<_, _>>())
}

fn closed<'a>(rows: impl IntoIterator<Item = (&'a str, Json)>, required: &[&str]) -> Json {
    json!({"type": "object", "properties": object(rows), "required": required, "additionalProperties": false})
}

fn named(what: Json, doc: &str) -> Json {
    json!({"type": "object", "additionalProperties": what, "description": doc})
}

fn text(doc: &str) -> Json {
    json!({"type": "string", "description": doc})
}

fn time(doc: &str) -> Json {
    json!({"$ref": "#/$defs/time", "description": doc})
}

fn choice<'a>(words: impl IntoIterator<Item = &'a str>, doc: &str) -> Json {
    json!({"enum": words.into_iter().collect::<Vec<_>>(), "description": doc})
}

fn burden() -> Json {
    let cpus = json!({"type": "array", "minItems": 1, "items": {"type": "integer", "minimum": 0, "maximum": 63},
        "description": "The processors on which it may run; all when nothing is said."});
    let priority = json!({"type": "integer", "minimum": 1, "maximum": 94, "description": "Its priority."});
    let rows = [
        ("priority", priority),
        ("share", range(0.0, 0.99, "How much of a processor it takes.")),
        ("cpus", cpus),
        ("period", time("The time between two pieces of its work; 10 ms when nothing is said.")),
        ("from", time("When it begins, counted from the start.")),
        ("until", time("When it ends.")),
    ];
    closed(rows, &["priority", "share"])
}

fn flag(doc: &str) -> Json {
    json!({"type": "boolean", "description": doc})
}

fn range(least: f64, most: f64, doc: &str) -> Json {
    json!({"type": "number", "minimum": least, "maximum": most, "description": doc})
}

/// Words that an editor offers where others are allowed too.
fn open_choice<'a>(words: impl IntoIterator<Item = &'a str>, doc: &str) -> Json {
    json!({"anyOf": [{"enum": words.into_iter().collect::<Vec<_>>()}, {"type": "string"}], "description": doc})
}

fn one_or_more(item: &Json) -> Json {
    json!({"anyOf": [item, {"type": "array", "items": item}]})
}

/// `[agent.NAME]` with an agent of this type.
fn agent(kind: &AgentType) -> Json {
    let takes = |port: &&PortInfo| port.shape.comes_in();
    let inputs: Vec<Json> = kind
        .ports
        .iter()
        .filter(takes)
        .map(|port| json!({"const": port.name, "description": port.doc}))
        .collect();
    let on = if inputs.is_empty() { json!(false) } else { one_or_more(&json!({"anyOf": inputs})) };
    let usual = ExecutorPlan::usual();
    let executors = usual.iter().map(|executor| executor.name.as_str());
    let common = [
        ("is", json!({"const": kind.kind, "description": kind.doc})),
        ("robot", text("The robot to whose ports it is wired.")),
        ("period", time("Time between two steps.")),
        ("period_min", time("The shortest period that its designer allows.")),
        ("period_max", time("The longest period that its designer allows.")),
        ("cost", time("Processor time of a step at worst, where it is known.")),
        (
            "deadline",
            time("How soon after its release a step must be done; the period when nothing is said."),
        ),
        ("on", on),
        ("min_gap", time("The least time between two steps that messages make it run.")),
        (
            "wake_gap",
            time(
                "The least time between two steps that it asks for itself; the analysis counts them where it is said.",
            ),
        ),
        (
            "executor",
            open_choice(executors, "The thread it runs on; chosen by the deadline when nothing is said."),
        ),
        ("on_death", choice(["restart", "leave"], "What happens when it dies.")),
        ("hang_after", time("How long a step may last before it is taken for one that does not return.")),
        (
            "importance",
            range(0.0, 1.0, "How important it is to a resource manager; 0.5 when nothing is said."),
        ),
        (
            "elasticity",
            range(0.0, 1e6, "How readily its period gives way, beside those of others; 0 for not at all."),
        ),
        (
            "gap_max",
            time("How far the least time between two steps that messages make it run may be lengthened."),
        ),
        ("may_suspend", flag("Whether it may be suspended, when nothing else is left.")),
        ("rigid", flag("Whether a resource manager is not to touch it, whatever else is said.")),
        ("suspended", flag("Whether it begins suspended: it makes no step.")),
    ];
    let names = || kind.methods.iter().map(|method| method.name);
    let methods = (!kind.methods.is_empty()).then(|| {
        let costs = object(names().map(|name| (name, time("Processor time of a step by it at worst."))));
        [
            ("method", choice(names(), "How it does its step; the best when nothing is said.")),
            (
                "methods",
                json!({"type": "object", "properties": costs, "additionalProperties": false,
                "description": "Processor time of a step by each of its methods at worst."}),
            ),
        ]
    });
    let refines = kind.is_anytime.then(|| {
        [
            ("refinement", time("Processor time of one refinement at worst.")),
            ("budget", time("How long a step may take with its refinements.")),
        ]
    });
    let common = common.into_iter().chain(methods.into_iter().flatten()).chain(refines.into_iter().flatten());
    let params = kind.params.iter().map(|field| (field.name, parameter(field)));
    let mut schema = closed(common.chain(params), &["is"]);
    schema["title"] = json!(kind.kind);
    schema["description"] = json!(format!("{} {}", kind.doc, ports(kind)));
    schema
}

fn ports(kind: &AgentType) -> String {
    let list = |takes: bool| {
        let messages = kind.ports.iter().filter(|port| port.shape.direction != Direction::Router);
        let ports = messages.filter(|port| port.shape.input.is_some() == takes);
        ports.map(|port| port.name).collect::<Vec<_>>().join(", ")
    };
    format!("Takes: {}. Gives: {}.", list(true), list(false))
}

/// The kinds are named in messages for people; this is their meaning for a schema.
fn parameter(field: &ParamField) -> Json {
    let mut schema = match &field.default {
        Value::Bool(_) => json!({"type": "boolean"}),
        Value::Int(_) => json!({"type": "integer"}),
        Value::Float(_) => json!({"type": "number"}),
        Value::List(_) => json!({"type": "array"}),
        // The name of a pattern in the store stands for its table.
        Value::Table(_) if field.name == "pattern" => json!({"type": ["object", "string"]}),
        // "world", or the name of a file.
        Value::Table(_) if field.name == "floor" => json!({"type": ["object", "string"]}),
        Value::Table(_) => json!({"type": "object"}),
        Value::Text(_) if field.kind.starts_with("a time") => json!({"$ref": "#/$defs/time"}),
        Value::Text(_) if !field.words.is_empty() => json!({"enum": field.words}),
        Value::Text(_) => json!({"type": "string"}),
    };
    if matches!(field.default, Value::Int(_) | Value::Float(_)) {
        for (key, bound) in [("minimum", field.min), ("maximum", field.max)] {
            if let Some(bound) = bound {
                schema[key] = json!(bound);
            }
        }
    }
    schema["description"] = json!(field.doc);
    schema["default"] = json_of(&field.default);
    schema
}

fn group() -> Json {
    json!({
        "title": "a group",
        "type": "object",
        "properties": {
            "use": text("A system file whose agents are added under this name."),
            "robot": text("The robot to whose ports they are wired."),
        },
        "required": ["use"],
        "additionalProperties": {"type": "object", "description": "Changes to one of its agents."},
        "description": "The agents of another file under a prefix.",
    })
}

fn world_() -> Json {
    let doc = "The simulated world; absent on a real robot.";
    json!({"anyOf": [open_choice(Shelf::Worlds.names(), doc), {"type": "object"}], "description": doc})
}

fn robot(kind: Option<&AgentType>) -> Json {
    let gate = kind.map(|kind| kind.params.as_slice()).unwrap_or_default();
    let driver = open_choice(["sim"], "Its driver: sim, carmen:FILE, ticks:FILE or replay:FILE.");
    let model = json!({"enum": sim::model::NAMES, "description": "Its model, where it is simulated: h1 without a word."});
    let rows = [("driver", driver), ("model", model)]
        .into_iter()
        .chain(gate.iter().map(|field| (field.name, parameter(field))));
    json!({
        "type": "object",
        "properties": object(rows),
        "required": ["driver"],
        "description": "A robot: its driver, what its gate lets pass, and entries of its model where it is simulated.",
    })
}

fn executor() -> Json {
    let priority = json!({"type": "integer", "minimum": 1, "maximum": 94,
        "description": "Real-time priority; an ordinary thread when nothing is said."});
    let cpus = json!({"type": "array", "minItems": 1, "items": {"type": "integer", "minimum": 0},
        "description": "The processors on which it may run."});
    let spin = time("How long before a release it stops sleeping and watches the clock.");
    let policy = choice(
        Policy::ALL.map(Policy::name),
        "By which rule the thread runs: by its priority, or by the deadline of its one agent.",
    );
    let mut schema =
        closed([("policy", policy), ("priority", priority), ("cpus", cpus), ("spin", spin)], &[]);
    let other = |entry: &str| json!({"not": {"required": [entry]}});
    schema["if"] = json!({"properties": {"policy": {"const": "deadline"}}, "required": ["policy"]});
    let none = ["priority", "cpus", "spin"].map(other);
    schema["then"] = json!({"allOf": none});
    schema
}

const POLICIES: [Overload; 3] = [Overload::NewestWins, Overload::OldestWins, Overload::Refuse];

fn queue() -> Json {
    let depth = json!({"type": "integer", "minimum": 1,
        "description": "How many messages of one sender and one priority wait at most."});
    let overload = choice(POLICIES.map(Overload::name), "What happens when there is no room.");
    closed([("depth", depth), ("overload", overload)], &[])
}

fn wires() -> Json {
    let whole = |least: i64, doc: &str| json!({"type": "integer", "minimum": least, "description": doc});
    let policies = POLICIES.map(Overload::name);
    let rows = [
        ("to", json!({"$ref": "#/$defs/port"})),
        ("depth", whole(1, "How many messages wait at most.")),
        ("overload", choice(policies, "What happens when there is no room.")),
        (
            "serving",
            json!({"type": "integer", "minimum": 0, "maximum": runtime::MOST_SERVING,
            "description": "Out of a queue: who is called first; the highest."}),
        ),
        ("every", whole(0, "Only every n-th message passes.")),
        ("priority", choice(Priority::ALL.map(Priority::name), "Only this priority or a higher one passes.")),
        ("marker", whole(0, "Only this marker passes.")),
        ("category", choice(Category::ALL.map(Category::name), "Only this category passes.")),
        ("recipient", text("Only what is for this agent, or for everybody, passes.")),
    ];
    let target = json!({"anyOf": [{"$ref": "#/$defs/port"}, closed(rows, &["to"])]});
    // A name without quotes is a table in a table for TOML.
    let nested = json!({"type": "object", "not": {"required": ["to"]}});
    json!({
        "type": "object",
        "additionalProperties": {"anyOf": [target, {"type": "array", "items": target}, nested]},
        "description": "From each output to its inputs.",
    })
}

fn decide() -> Json {
    let share = |doc: &str| json!({"type": "number", "minimum": 0, "maximum": 1, "description": doc});
    let rate = json!({"type": "number", "exclusiveMinimum": 0, "maximum": 1,
        "description": "The share of its nominal rate."});
    let settings = closed(
        [
            ("weight", share("The weight of its offers.")),
            ("importance", share("How much it matters.")),
            ("rate", rate),
            ("active", json!({"type": "boolean", "description": "Whether it is to work."})),
            ("method", text("How it is to work, in a word that it knows.")),
        ],
        &[],
    );
    let of_agent = json!({"anyOf": [share("The weight of its offers."), settings]});
    let row = |doc: &str| {
        json!({
            "type": "object",
            "properties": object([
                ("when", text("The condition under which the situation begins, as in battery < 0.2.")),
                ("until", text("The condition under which it ends; where it is missing, the situation ends with its beginning.")),
                ("priority", json!({"type": "integer", "minimum": 0, "maximum": 1000,
                    "description": "The active situation of the highest priority counts that says something."})),
                ("goal", text("What the robot is to strive for.")),
            ]),
            "additionalProperties": of_agent,
            "description": doc,
        })
    };
    let built_in = agents::decision_maker::Situation::ALL;
    let built_in = built_in.map(|situation| (situation.name(), row("What each agent is given.")));
    // A name without quotes is a table in a table for TOML.
    let nested = json!({"type": "object", "additionalProperties": {"type": "object"}});
    json!({
        "type": "object",
        "properties": object(built_in),
        "additionalProperties": {"anyOf": [row("A situation of one's own: when it is active, and what each agent is given."), nested]},
        "description": "What counts how much in which situation.",
    })
}

fn knowledge() -> Json {
    let mut schema = closed(
        [
            ("file", text("The store, beside the system file; made where it is not there.")),
            ("begins", text("What the calendar shows when a simulated run begins, as in 2026-03-02 07:59.")),
            ("decide", text("The decision table of the store that is the decision maker's.")),
        ],
        &["file"],
    );
    schema["description"] = json!("What is known from one run to the next: a store that the run reads.");
    schema
}

fn goal() -> Json {
    let stage = closed(
        [
            ("inside", text("The region in which the robot must be.")),
            ("near", text("The person or thing to which the robot must be near.")),
            ("follows", text("The person that the robot must follow.")),
            (
                "moved",
                json!({"type": "number", "minimum": 0, "description": "How far it must get from where the stage began (m)."}),
            ),
            ("turned", json!({"type": ["string", "number"], "description": "How far the robot must turn."})),
            ("distance", json!({"type": "number", "minimum": 0, "description": "How near (m)."})),
            ("time", time("For how long in all it must follow.")),
            ("hold", time("For how long the condition must hold without a break.")),
        ],
        &[],
    );
    let collisions =
        json!({"type": "integer", "minimum": 0, "description": "How many collisions are forgiven."});
    let stages = json!({"type": "array", "items": stage, "description": "The stages, one after another."});
    let mut schema = closed(
        [("within", time("The time for the whole.")), ("collisions", collisions), ("stage", stages)],
        &["stage"],
    );
    schema["description"] = json!("What makes a run a success.");
    schema
}

fn figure() -> Json {
    let shows = json!({"enum": ["way", "velocity"], "description":
        "The way on the floor, or speed, turn rate and heading over time."});
    closed(
        [
            ("name", text("The name of its files.")),
            ("shows", shows),
            ("from", time("Its first time, counted from the start.")),
            ("until", time("Its last time.")),
        ],
        &["name", "shows", "from", "until"],
    )
}

fn request() -> Json {
    let words = one_or_more(&json!({"type": "string"}));
    closed([("time", time("When, counted from the start.")), ("do", words)], &["time", "do"])
}
