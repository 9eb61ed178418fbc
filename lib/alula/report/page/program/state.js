// The first thing that is looked at: how the mission is, what is active, the robot's figures, what is wrong, the last events; at one moment.
// At the end of a run that is over the figures are those of the whole run.

const RECENT = 6;
const FAR_CLOCK_S = 0.05;

/** What runs at t: [{name, since, inputs}], in the order of their starts. */
function activeAt(run, t) {
  const open = [...run.executions.values()].filter(({ running, end }) => running !== null && running <= t && (end === null || end > t));
  return open.sort((one, other) => one.running - other.running).map(({ skill, running, inputs }) => ({ name: skill, since: running, inputs: listed(inputs) }));
}

/** Times and values of a field that is named as "skillset.data.field"; undefined where the record has none. */
function columnOf(run, name) {
  const [skillset, data, ...field] = (name ?? "").split(".");
  const samples = run.data.get(`${skillset}.${data}`);
  const column = samples?.columns.get(field.join("."));
  return column && { t: samples.t, column };
}

/** The newest reading at t of a field that is named so: {name, value, since}; undefined where the record has none. */
function namedFieldAt(run, t, name) {
  const found = columnOf(run, name);
  return found && { name, ...readingAt(found.t, found.column, t) };
}

/** The newest reading at t of the first data that has such a field: {value, since}; undefined where no data has it. */
function fieldAt(run, t, pattern) {
  for (const { t: times, columns } of run.data.values()) for (const [name, column] of columns) if (pattern.test(name)) return { name, ...readingAt(times, column, t) };
  return undefined;
}

/** The robot's figures at t: [{label, text, tone}]; what nothing measures says so. */
function readings(run, t) {
  const deployment = deploymentOf(run);
  if (deployment) return deploymentReadings(deployment);
  const numbers = (patterns) => patterns.map((pattern) => fieldAt(run, t, pattern));
  const told = (label, fields, write) => {
    if (fields.some((field) => field === undefined)) return null; // the robot has no such data
    const { value, since } = fields.find((one) => one.value === null) ?? fields[0];
    if (value !== null && value !== undefined) return { label, ...write(...fields.map((one) => one.value)) };
    return { label, text: since === null ? "not measured yet" : `no data since ${seconds(since - origin(run))}`, tone: since === null ? "soft" : "fair" };
  };
  const position = numbers([/position_enu_m\.x$/, /position_enu_m\.y$/]);
  const [height] = numbers([/position_enu_m\.z$/]);
  const [battery] = numbers([/battery/]);
  const reached = valueAt(run.blackboard.get("waypoints_reached") ?? newTrack(), t) ?? 0;
  const of = last(run.mission.v)?.waypoints;
  const shown = [
    robotWords(run).flat ? null : told("height", [height], (z) => ({ text: `${fixed(z, 1)} m` })),
    told("speed", numbers([/velocity_enu_m_s\.x$/, /velocity_enu_m_s\.y$/, /velocity_enu_m_s\.z$/]), (...v) => ({ text: `${fixed(Math.hypot(...v), 1)} m/s` })),
    told("battery", [battery], (value) => batteryTold(battery.name, value)),
    linkAt(run, t, told),
    told("east, north of home", position, (x, y) => ({ text: `${fixed(x, 1)} m, ${fixed(y, 1)} m` })),
    { label: robotWords(run).away, text: awayTold(run, t) },
    ...(of ? [{ label: "waypoints", text: `${reached} of ${of}` }] : []),
    told(`${robotWords(run).controller}'s mode`, [namedFieldAt(run, t, robotWords(run).mode)], (mode) => ({ text: String(mode), tone: modesOf(run)[mode] ? "fair" : "" })),
  ];
  return shown.filter(Boolean);
}

/** What runs of a deployment, whether the other computer's master answers, and how far its clock is from this computer's. */
function deploymentReadings({ parts, master }) {
  const shown = parts.map(({ name, state }) => ({ label: name, text: state, tone: state === "running" ? "" : "bad" }));
  if (master.uri) shown.push({ label: "link to the ROS master", text: master.problem ? "lost" : "up", tone: master.problem ? "bad" : "" });
  const { ahead_s: ahead } = master;
  if (ahead !== undefined) shown.push({ label: "clock of its computer", text: `${ahead > 0 ? "+" : "−"}${fixed(Math.abs(ahead), 3)} s`, tone: Math.abs(ahead) > FAR_CLOCK_S ? "fair" : "" });
  return shown;
}

/** What is wrong with it: [{text, tone, since}]. */
function deploymentWrong({ parts, master, disk }) {
  const found = parts.filter(({ state }) => state !== "running").map(({ name, state, why }) => ({ text: `${name} does not run (${state})${why ? `: ${why}` : ""}`, tone: "bad", since: null }));
  if (master.problem) found.push({ text: `the ROS master at ${master.uri}: ${master.problem}`, tone: "bad", since: null });
  if (Math.abs(master.ahead_s ?? 0) > FAR_CLOCK_S) found.push({ text: `the clocks of the two computers are ${fixed(Math.abs(master.ahead_s), 3)} s apart`, tone: "fair", since: null });
  if (disk) found.push({ text: disk, tone: "fair", since: null });
  return found;
}

function awayTold(run, t) {
  if (run.departure === null || t < run.departure) return "not yet";
  const back = comingBack(run);
  return back !== null && t >= back ? `${seconds(back - origin(run))}, ${cameBack(run)}` : seconds(t - origin(run));
}

/** A battery's charge: a share or per cent; other units as they are. */
function batteryTold(name, value) {
  if (typeof value !== "number") return { text: String(value) };
  if (/volt|_v$/.test(name)) return { text: `${fixed(value, 1)} V` };
  const percent = value <= 1 ? 100 * value : value;
  return { text: `${fixed(percent, 0)} %`, tone: percent < 20 ? "bad" : percent < 35 ? "fair" : "" };
}

/** The links: the controller's, and each resource that is one. */
function linkAt(run, t, told) {
  const parts = [];
  const { controller, link, links } = robotWords(run);
  const heard = namedFieldAt(run, t, link);
  if (heard) parts.push(told("link", [heard], (up) => (up ? { text: `${controller} up` } : { text: `${controller} lost`, tone: "bad" })));
  for (const name of links.filter((one) => run.resources.has(one))) {
    const { state, alarm } = valueAt(run.resources.get(name), t) ?? { state: "unknown" };
    parts.push({ text: `${name.split(".")[0]} ${state.toLowerCase()}`, tone: isAlarm(run, alarm, t) ? "bad" : "" });
  }
  const tone = ["bad", "fair", "soft"].find((one) => parts.some((part) => part.tone === one));
  return parts.length ? { label: "link", text: parts.map(({ text }) => text).join(", "), tone } : null;
}

/** What is wrong at t: [{text, tone, since}]. */
function wrongAt(run, t) {
  const deployment = deploymentOf(run);
  if (deployment) return deploymentWrong(deployment);
  const found = [];
  const left = run.departure !== null && t >= run.departure;
  if (!left && !run.over) for (const [needed, otherwise] of valueAt(run.start, t) ?? []) if (otherwise) found.push({ text: `before the start: ${otherwise || needed}`, tone: "fair", since: null });
  const held = valueAt(run.held, t) ?? null;
  if (held !== null && outcomeOf(run) === "running") found.push({ text: "the mission is paused", tone: "fair", since: run.held.t[indexAt(run.held.t, t)] });
  found.push(...faultsAt(run, t), ...endedBadly(run, t));
  for (const [name, track] of run.resources) {
    const index = indexAt(track.t, t);
    if (index >= 0 && isAlarm(run, track.v[index].alarm, t)) found.push({ text: `${name.split(".")[1]} is ${track.v[index].state}`, tone: "bad", since: track.t[index] });
  }
  for (const [sensor, track] of run.health) {
    const index = indexAt(track.t, t);
    if (index >= 0 && !track.v[index].ok) found.push({ text: `${sensor}: ${track.v[index].reason || track.v[index].fault}`, tone: "bad", since: track.t[index] });
  }
  const since = isAway(run, t) ? fieldAt(run, t, /position_enu_m\.z$/)?.since : null;
  if (since) found.push({ text: "no position", tone: "bad", since });
  const crash = run.facts["/summary"]?.crash;
  if (crash && t >= (comingBack(run) ?? Infinity)) found.push({ text: `crashed: ${crash}`, tone: "bad", since: comingBack(run) });
  return found;
}

/** What has failed and does so still; where a resource tells of it, that is enough. */
function faultsAt(run, t) {
  const lasting = faultsOf(run).filter((fault) => fault.t <= t && (fault.until === null || t < fault.until));
  const shown = (name) => isAlarm(run, valueAt(run.resources.get(name) ?? newTrack(), t)?.alarm, t);
  return lasting.filter(({ resource }) => !resource || !shown(resource)).map((fault) => ({ text: fault.text, tone: "bad", since: fault.t }));
}

/** Skills whose last execution ended badly, and that do not run again. */
function endedBadly(run, t) {
  const latest = new Map();
  for (const one of run.executions.values()) if (one.start <= t) latest.set(`${one.skillset}.${one.skill}`, one);
  const ended = [...latest.values()].filter((one) => one.end !== null && one.end <= t && ["violated", "failure"].includes(endingOf(one)));
  return ended.map((one) => ({ text: `${one.skill}: ${endingOf(one) === "violated" ? `invariant ${one.result} violated` : `${words(one.state)} ${one.result}`.trim()}`, tone: "fair", since: one.end }));
}

/** Why nothing is active: a mission that has not begun says what it waits for. */
function nothingTold(run, t) {
  if (deploymentOf(run)) return "no mission";
  if (outcomeOf(run) !== "running") return "nothing any more";
  const unmet = (valueAt(run.start, t) ?? []).filter(([, otherwise]) => otherwise).map(([, otherwise]) => otherwise);
  return unmet.length ? `nothing yet: the mission waits, ${unmet.join(", ")}` : "nothing yet";
}

/** Shows all of that. */
function showState(t) {
  const zero = origin(run);
  const ago = (since) => (Number.isFinite(since) ? ` (since ${seconds(since - zero)})` : ""); // apart: a sentence may end with causes
  const active = activeAt(run, t);
  rewrite(byId("active"), active.length ? active : [nothingTold(run, t)], (one) => (one.name ? el("li", { title: one.inputs }, el("b", {}, one.name), el("span", {}, `since ${seconds(one.since - zero)}`)) : el("li", { class: "hint" }, one)));
  rewrite(byId("readings"), readings(run, t), ({ label, text, tone }) => el("div", { class: tone ?? "" }, el("dt", {}, label), el("dd", {}, text)));
  const whole = Boolean(run.facts["/summary"]) && cursor === null; // at the end of a run that is over, what it came to
  [byId("readings").hidden, byId("figures-row").hidden] = [whole, !whole];
  const tasks = whole ? tasksOf(run) : [];
  byId("tasks").hidden = !tasks.length;
  rewrite(byId("tasks"), tasks, ({ name, done, why }) => el("li", { class: done ? "good" : "bad" }, el("b", {}, name), el("span", {}, done ? "done" : `not done${why && `: ${why}`}`)));
  const wrong = wrongAt(run, t);
  rewrite(byId("wrong"), wrong.length ? wrong : [null], (one) => (one ? el("li", { class: one.tone }, `${one.text}${ago(one.since)}`) : el("li", { class: "good" }, "Nothing is known to be wrong.")));
  const upTo = currentEvent(t) + 1;
  const recent = run.moments.slice(Math.max(0, upTo - RECENT), upTo).reverse();
  rewrite(byId("recent"), recent, (event) => el("li", { class: event.bad ? "bad" : "" }, el("button", { type: "button", onclick: () => choose(event.t, event) }, seconds(event.t - zero, 2)), el("span", {}, event.text)));
}
