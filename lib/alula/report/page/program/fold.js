// What a run was, folded from its entries [topic, t_s, value]. Live they come over a socket, in a report they are inside the page: one fold.
//
// The fold only appends: to tracks (what something was, from when on), to lists, to facts of the whole run. What was so at a moment is
// looked up in the tracks by bisection, so the slider costs the same at any moment of a run of hours.

const TERMINAL = new Set(["NOT_VALIDATED", "NOT_READY", "RESOURCE_INVARIANT_VIOLATED", "INTERRUPTED", "TERMINATED", "FAILED"]);

function newTrack() {
  return { t: [], v: [] };
}

/** Adds a value from t on; what comes late counts from the last one on, so a track's times never fall. */
function push(track, t, value) {
  const last = track.t.length ? track.t[track.t.length - 1] : t;
  track.t.push(Math.max(t, last));
  track.v.push(value);
}

/** Index of the last moment that is not after t, or -1. */
function indexAt(times, t) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function valueAt(track, t) {
  const index = indexAt(track.t, t);
  return index < 0 ? undefined : track.v[index];
}

const last = (list) => list[list.length - 1];

/** The moment of what came before the mission clock was heard: earlier than any other, and shown without a time. */
const BEFORE = -Infinity;

/** Orders by time; what has none stays in the order in which it came. */
const byTime = (one, other) => (one.t === other.t ? 0 : one.t - other.t);

function newRun() {
  return {
    over: false, // whether the server says that nothing of the run is under way any more
    begin: null, // first and last moment, seconds of mission clock
    end: null,
    count: 0,
    news: 0, // entries other than samples: what the words and the bars are made of
    facts: {}, // topic -> value, of the whole run
    mission: newTrack(),
    start: newTrack(), // [[needed, otherwise]]: what the mission needs to start, in its words; otherwise is empty where it is met
    held: newTrack(), // what a pause of the mission holds, in words; null: it is not paused
    trees: [], // {t, nodes: [{index, depth, parent, children, kind, name, skill, source, place, track}]}
    executions: new Map(), // skillset/skill/id -> {skillset, skill, id, inputs, outputs, changes}
    resources: new Map(), // skillset.resource -> track of {state, from, cause}
    data: new Map(), // skillset.data -> {t, columns}
    blackboard: new Map(),
    path: { t: [], v: [] },
    told: false, // whether the path comes from the run's other recordings
    faults: [],
    health: new Map(),
    pictures: new Map(), // camera -> track of JPEGs, base64
    decisions: [],
    ticked: [], // of a tree that was ticked without a robot: {t, number, root}
    operator: [],
    moments: [], // what the list of events shows: {t, kind, text, bad}
    departure: null, // when the robot left where it began
    back: null, // when it was back there for the last time
  };
}

const FOLDERS = {
  "/mission": (run, t, value) => {
    const before = last(run.mission.v);
    push(run.mission, t, value);
    if (before?.outcome !== value.outcome) moment(run, t, "mission", value.outcome === "running" ? "the mission's process is up" : `mission ${words(value.outcome)}${value.told ? `: ${value.told}` : ""}`);
  },
  "/ticks": (run, t, { unmet, conditions }) => {
    const known = Array.isArray(conditions) ? conditions.map(([needed, otherwise]) => [String(needed), String(otherwise ?? "")]) : sentences(unmet).map((sentence) => ["", sentence]);
    if (known.length || !run.start.t.length) push(run.start, t, known); // once it has started, what it needed stays as it was then: met
  },
  "/events": (run, t, value) => (value.kind === "TRANSITION" ? foldTransition(run, t, value) : foldExecution(run, t, value)),
  "/tree": (run, t, shape) => foldTree(run, t, shape),
  "/nodes": (run, t, changes) => {
    const nodes = last(run.trees)?.nodes ?? [];
    for (const [index, status, message] of changes) if (nodes[index]) push(nodes[index].track, t, { status, message });
  },
  "/data": (run, t, value) => foldData(run, t, value),
  "/path": (run, t, place) => {
    if (!run.told) run.path = { t: [], v: [] };
    run.told = true;
    push(run.path, t, place);
  },
  "/fault": (run, t, value) => {
    run.faults.push({ t, ...value });
    moment(run, t, "fault", `failure injected: ${value.sensor} ${value.mode}`, true);
  },
  "/health": (run, t, value) => {
    if (!run.health.has(value.sensor)) run.health.set(value.sensor, newTrack());
    push(run.health.get(value.sensor), t, value);
    moment(run, t, "measurement", value.ok ? `${value.sensor} is fine` : `${value.sensor} ${value.fault}: ${value.reason}`, !value.ok);
  },
  "/told": (run, t, { words }) => moment(run, t, "told", words, true),
  "/blackboard": (run, t, values) => {
    for (const [name, value] of Object.entries(values)) {
      if (!run.blackboard.has(name)) run.blackboard.set(name, newTrack());
      push(run.blackboard.get(name), t, value);
    }
  },
  "/picture": (run, t, { camera, jpeg }) => {
    if (typeof jpeg !== "string" || !/^[A-Za-z0-9+/]+=*$/.test(jpeg)) return;
    const name = String(camera);
    if (!run.pictures.has(name)) run.pictures.set(name, newTrack());
    push(run.pictures.get(name), t, jpeg);
  },
  "/ticked": (run, t, value) => {
    run.ticked.push({ t, ...value });
    moment(run, t, "tick", String(value.text), value.root === "FAILURE");
  },
  "/decisions": (run, t, value) => run.decisions.push({ t, ...value }),
  "/operator": (run, t, value) => {
    if (value.by === "mission" && ["pause", "paused", "resume", "abort"].includes(value.command)) push(run.held, t, /^pause/.test(value.command) ? String(value.reason ?? "") : null);
    run.operator.push({ t, ...value });
    moment(run, t, "operator", `operator ${value.by ?? ""}: ${value.command}${value.answer || value.reason ? ` (${value.answer || value.reason})` : ""}`);
  },
};

const SAMPLES = new Set(["/data", "/path", "/picture"]);

/** Adds one entry to what is known. */
function fold(run, [topic, t, value]) {
  run.count += 1;
  if (!SAMPLES.has(topic)) run.news += 1;
  const folder = FOLDERS[topic];
  if (t !== null) {
    run.begin = run.begin === null ? t : Math.min(run.begin, t);
    run.end = run.end === null ? t : Math.max(run.end, t);
  } else if (!folder) run.facts[topic] = value;
  if (topic === "/causes") [run.departure, run.back] = [value.departed_s, value.back_s];
  if (t !== null || !SAMPLES.has(topic)) folder?.(run, t ?? BEFORE, value);
  return run;
}

/** Adds to the list of moments, in order of time: skillsets' events cross by some milliseconds. */
function moment(run, t, kind, text, bad = false) {
  const entry = { t, kind, text, bad };
  let place = run.moments.length;
  while (place > 0 && run.moments[place - 1].t > t) place -= 1;
  run.moments.splice(place, 0, entry);
}

function foldTransition(run, t, value) {
  const name = `${value.skillset}.${value.resource}`;
  if (!run.resources.has(name)) run.resources.set(name, newTrack());
  const track = run.resources.get(name);
  if (!track.t.length) push(track, run.begin ?? t, { state: value.from_state, from: "", cause: "" });
  push(track, t, { state: value.to_state, from: value.from_state, cause: value.cause, reason: value.reason || "", alarm: value.alarm });
  const bad = isAlarm(run, value.alarm, t);
  if (value.cause === "extern" || bad) moment(run, t, "resource", `${name}: ${value.from_state} → ${value.to_state} (${value.cause})${value.reason ? `: ${value.reason}` : ""}`, bad);
}

/** Whether the robot is away from where it began, at t. */
const isAway = (run, t) => run.departure !== null && t >= run.departure && (run.back === null || t < run.back);

/** Whether a resource's state is bad news at t: some are only while the robot is away. */
const isAlarm = (run, alarm, t) => alarm === "always" || (alarm === "away" && isAway(run, t));

function foldExecution(run, t, value) {
  const key = `${value.skillset}/${value.skill}/${value.id}`;
  if (!run.executions.has(key)) {
    run.executions.set(key, { skillset: value.skillset, skill: value.skill, id: value.id, inputs: value.inputs ?? {}, outputs: {}, start: t, running: null, end: null, state: "", result: "", message: "" });
  }
  const execution = run.executions.get(key);
  if (execution.end !== null) return; // the first end counts
  Object.assign(execution, { state: value.state, result: value.result || execution.result, result_kind: value.result_kind, message: value.message || execution.message });
  if (value.state === "RUNNING" && execution.running === null) execution.running = t;
  if (TERMINAL.has(value.state)) Object.assign(execution, { end: t, outputs: value.outputs ?? {} });
  if (value.state === "RUNNING") moment(run, t, "skill", `${value.skillset}.${value.skill} runs`);
  else if (TERMINAL.has(value.state)) {
    const ending = endingOf(execution);
    moment(run, t, "skill", `${value.skillset}.${value.skill} ${ENDINGS[ending].words}${value.why ? `: ${value.why}` : ""}${value.result ? ` (${value.result})` : ""}`, ending === "violated" || ending === "failure");
  }
}

function foldTree(run, t, shape) {
  const nodes = [];
  const open = [];
  for (const [depth, kind, name, skill, source, place] of shape) {
    const node = { index: nodes.length, depth, kind, name, skill, source: source ?? "", place: place ?? "", parent: depth ? open[depth - 1] : null, children: [], track: newTrack() };
    node.parent?.children.push(node);
    open[depth] = node;
    nodes.push(node);
  }
  run.trees.push({ t, nodes });
}

function foldData(run, t, { skillset, data, value }) {
  const name = `${skillset}.${data}`;
  if (!run.data.has(name)) run.data.set(name, { t: [], columns: new Map() });
  const samples = run.data.get(name);
  const repeated = repeatedIn(value);
  samples.t.push(Math.max(t, last(samples.t) ?? t));
  for (const [field, leaf] of leaves(value, "")) {
    if (!samples.columns.has(field)) samples.columns.set(field, new Array(samples.t.length - 1).fill(null));
    const column = samples.columns.get(field);
    column.push(repeated(field, leaf) ? repeatOf(column, samples.t) : leaf);
  }
  for (const column of samples.columns.values()) if (column.length < samples.t.length) column.push(null);
  const place = value?.position_enu_m;
  if (place && !run.told && [place.x, place.y, place.z].every(Number.isFinite)) push(run.path, t, [place.x, place.y, place.z]);
}

const OF_FRAMES = new Set(["quality", "quality_margin", "delay_s", "loss", "received_bps"]);

/** Which fields of a message repeat an old measurement: of a stream that is not sent every number, of one without frames those of frames. */
function repeatedIn(value) {
  if (value?.streaming === false) return (field, leaf) => typeof leaf === "number";
  return value?.fps === 0 ? (field) => OF_FRAMES.has(field) : () => false;
}

/** What stands in a column instead of a repeated number: {since}, when it was measured last; null: never. */
function repeatOf(column, times) {
  const before = last(column);
  if (before?.since !== undefined) return before;
  return { since: typeof before === "number" ? times[column.length - 1] : null };
}

const STALE_S = 2.5; // the slowest data come every two seconds

/** What a column held at t, {value, since}: a value that is too old, or that repeats an old one, is null, and `since` its moment. */
function readingAt(times, column, t) {
  const index = indexAt(times, t);
  if (index < 0) return { value: null, since: null };
  const value = column[index];
  if (value?.since !== undefined) return { value: null, since: value.since };
  return t - times[index] <= STALE_S ? { value, since: null } : { value: null, since: times[index] };
}

/** Numbers, words and truths in a value, by path; message headers say nothing to people. */
function* leaves(value, path) {
  if (value === null || value === undefined || Array.isArray(value)) return;
  if (typeof value !== "object") yield [path, value];
  else for (const [name, part] of Object.entries(value)) if (name !== "header" && !/^[A-Z_]+$/.test(name)) yield* leaves(part, path ? `${path}.${name}` : name);
}

/** Whether a drawing in time that was made up to `end` has to be made again: a step of less than a pixel or two is not seen. */
const outgrown = (run, end) => run.end - end > 0.002 * (run.end - run.begin);

// --- what follows from it ------------------------------------------------------------------------------------------------

const ENDINGS = {
  running: { words: "runs", mark: "…" },
  success: { words: "ended by itself", mark: "✓" },
  ended: { words: "ended, success unknown", mark: "·" },
  interrupted: { words: "was interrupted", mark: "◦" },
  violated: { words: "invariant violated", mark: "✗" },
  failure: { words: "failed or was refused", mark: "!" },
};

/** How an execution ended, in one of the six words above. */
function endingOf({ state, result_kind: kind }) {
  if (!TERMINAL.has(state)) return "running";
  if (state === "TERMINATED") return kind === "success" || kind === "failure" ? kind : "ended";
  return { RESOURCE_INVARIANT_VIOLATED: "violated", INTERRUPTED: "interrupted" }[state] ?? "failure";
}

/** The departure, origin of all times that are shown; the first moment of a run without one. */
function origin(run) {
  return run.facts["/summary"]?.lift_off?.stamp_s ?? run.departure ?? run.begin ?? 0;
}

/** The tree that was ticked at t. */
function treeAt(run, t) {
  const index = indexAt(run.trees.map((tree) => tree.t), t);
  return run.trees[Math.max(index, 0)];
}

/** Status, message and since when, of a node at t. */
function nodeAt(node, t) {
  const index = indexAt(node.track.t, t);
  return index < 0 ? { status: "INVALID", message: "", since: null } : { ...node.track.v[index], since: node.track.t[index] };
}

const sentences = (list) => (Array.isArray(list) ? list.map(String) : []);

const words = (text) => String(text ?? "").replaceAll("_", " ").toLowerCase();
