// The robot's way, in words: when and where it came back, what took it from the mission, how long a fallback held.

const AT_PLACE_M = 1; // so near counts as at home, or at a waypoint
// Before the run is known; what a robot says otherwise comes with it (alula.common.robot_page).
const WORDS = { departure: "departure", away: "under way", back: "back", moved: "travelled", stop: "stop", controller: "controller", tasks: "tasks", live: {}, modes: {}, glossary: {}, mode: null, link: null, links: [], charts: [], cameras: {}, figures: {}, fence: null, flat: false };

/** What the robot says of its pages: `page` in its robot.yaml. */
const robotWords = (run) => run.facts["/run"]?.words ?? WORDS;

/** The modes of the robot in which the mission does not command, and what it does in them. */
const modesOf = (run) => robotWords(run).modes;

/** What a run is on: mocks, or what the robot says of the options that are set. */
function onWhat(run) {
  const asked = run.facts["/run"] ?? {};
  if (asked.mock) return "over mocks";
  const { default: usual, ...options } = robotWords(run).live;
  const set = Object.keys(options).filter((name) => asked[name]);
  return set.length ? set.map((name) => options[name]).join(", ") : usual;
}

const sentence = (text) => text && text[0].toUpperCase() + text.slice(1);

/** When the robot came back for the last time; null: it has not. */
const comingBack = (run) => run.back;

/** The robot's places at its departure and when it had come back, {home, rest}; null for each that the record does not tell. */
function places(run) {
  const at = (t) => (t === null ? null : run.path.v[indexAt(run.path.t, t)] ?? null);
  const home = run.departure === null && !run.facts["/summary"]?.lift_off ? null : at(origin(run));
  return { home, rest: at(comingBack(run)) };
}

/** How the robot came back, as a word for it: a crash is none. */
function cameBack(run) {
  return run.facts["/summary"]?.crash ? "crashed" : robotWords(run).back;
}

/** Where the robot came to rest, as "12.0 m east, 0.0 m north of home, at waypoint 3"; empty where the record does not tell. */
function restWhere(run) {
  const { home, rest } = places(run);
  if (!home || !rest) return "";
  const [east, north] = [rest[0] - home[0], rest[1] - home[1]];
  const away = Math.hypot(east, north);
  if (away <= AT_PLACE_M) return `${fixed(away, 1)} m from home`;
  const along = (value, positive, negative) => `${fixed(Math.abs(value), 1)} m ${fixed(value, 1).startsWith("-") ? negative : positive}`;
  const ranges = (run.facts["/route"] ?? []).map(([x, y]) => Math.hypot(rest[0] - x, rest[1] - y));
  const nearest = ranges.indexOf(Math.min(...ranges));
  return `${along(east, "east", "west")}, ${along(north, "north", "south")} of home${ranges[nearest] <= AT_PLACE_M ? `, at waypoint ${nearest + 1}` : ""}`;
}

/** When the controller changed, while the robot was away, to a mode in which the mission does not command: [{t, mode, text}]. */
function controllerActs(run) {
  const acts = [];
  const [begin, end] = [run.departure ?? Infinity, comingBack(run) ?? Infinity];
  const { t = [], column = [] } = columnOf(run, robotWords(run).mode) ?? {};
  column.forEach((mode, index) => {
    if (!index || mode === column[index - 1] || !modesOf(run)[mode] || t[index] <= begin || t[index] >= end) return;
    acts.push({ t: toldBetween(run, t[index - 1], t[index]) ?? t[index], mode, text: `the ${robotWords(run).controller} changed to ${mode}: it ${modesOf(run)[mode]}` });
  });
  return acts;
}

/** When, between two samples of the mode, a resource told of what follows from the change; null: none did. */
function toldBetween(run, after, until) {
  for (const { t, v } of run.resources.values()) {
    const index = v.findIndex(({ alarm }, at) => alarm && t[at] > after && t[at] <= until);
    if (index >= 0) return t[index];
  }
  return null;
}

/** The skill that a failure's fallback began with: the one that the summary names, else one that came to run then. */
function fallbackOf(run, t) {
  const begun = [...run.executions.values()].filter(({ running }) => running !== null && Math.abs(running - t) < APART_S / 2);
  const skills = (run.facts["/summary"]?.answers ?? []).map(({ skill }) => skill);
  return begun.find((one) => skills.includes(`${one.skillset}.${one.skill}`)) ?? begun[0] ?? null;
}

/** How long a fallback held that ended badly, and what took over; empty of one that did not. */
function heldTold(run, t) {
  const skill = fallbackOf(run, t);
  const ending = skill && endingOf(skill);
  if (!["violated", "failure"].includes(ending)) return "";
  const act = controllerActs(run).find((one) => one.t > skill.running && one.t <= skill.end + APART_S);
  const why = ending === "violated" ? `its invariant ${skill.result} was violated` : "it failed";
  return `it held for ${seconds(skill.end - skill.running, 2)}, then ${act ? `the ${robotWords(run).controller} changed to ${act.mode}` : why}`;
}

/** That the fallback came to run, and what became of it where it ended badly. */
function fallbackTold(run, t) {
  const skill = fallbackOf(run, t);
  const held = heldTold(run, t);
  return `The fallback runs${skill ? `: ${skill.skill}` : ""}${held && `; ${held}`}.`;
}
