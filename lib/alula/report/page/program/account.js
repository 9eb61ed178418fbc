// What happened, in words: the outcome; a row a failure with what was done and what it cost; each failure's chain of causes. What failed of
// what, and what the mission did about it, is told by "/causes" (alula.report.page.causes): nothing is judged here.

const OUTCOMES = {
  accomplished: ["Mission accomplished", "good"],
  degraded: ["Mission accomplished in degraded mode", "fair"],
  given_up: ["Mission given up", "bad"],
  aborted: ["Mission aborted", "bad"],
  not_started: ["The mission did not start", "bad"],
  served: ["Skills served, without a mission", "good"],
  running: ["The mission is under way", "now"],
};

const APART_S = 0.1; // an event's stamp may be some ticks of the clock older than what caused it
const REACTION_S = 3; // for so long an act of the controller, or a death, goes with a failure

const NO_CAUSES = { departed_s: null, back_s: null, faults: [], failures: [] };

/** What is known of failures: {departed_s, back_s, faults: [{name, text, mark, began, ended, t, until, detected, resource, repair}], failures: [{key, skill, t, text, fault, chain, reacts_until, reaction}]}. */
const causesOf = (run) => run.facts["/causes"] ?? NO_CAUSES;
const faultsOf = (run) => causesOf(run).faults;
const failures = (run) => causesOf(run).failures;

/** What stays up between missions, {parts, master, disk}, where this is no mission's run but that of a deployment; else null. */
const deploymentOf = (run) => (run.facts["/run"]?.deployment && !run.facts["/run"].scenario ? { name: run.facts["/run"].deployment, parts: [], master: {}, disk: "", ...run.facts["/parts"] } : null);

/** How the mission ended, by its report where there is one: a mission that was killed could not tell; "running": it has not ended. */
const outcomeOf = (run) => run.facts["/summary"]?.outcome ?? last(run.mission.v)?.outcome ?? "running";

function headline(run) {
  const deployment = deploymentOf(run);
  if (deployment && run.over) return { text: `${deployment.name} is down`, tone: "bad", reason: "" };
  if (deployment) {
    const bad = deployment.parts.filter(({ state }) => state !== "running").length;
    return { text: `${deployment.name} is up${bad ? `, but for ${bad} of ${deployment.parts.length} parts` : ""}`, tone: bad ? "bad" : "good", reason: "Between missions: skills can be started one by one, under Manual control; a mission by the form above." };
  }
  const mission = last(run.mission.v) ?? {};
  const summary = run.facts["/summary"];
  if (run.ticked.length) return { text: `Ticked without a robot, ${run.ticked.length === 1 ? "once" : `${run.ticked.length} times`}`, tone: "now", reason: `the last tick: ${last(run.ticked).root}` };
  if (run.begin === null && run.mission.v.length) return { text: "The mission waits for its clock", tone: "now", reason: "" };
  if (run.begin === null) return { text: run.facts["/run"] ? "The run has recorded nothing yet" : "No run yet", tone: "now", reason: "" };
  const outcome = outcomeOf(run);
  if (outcome === "running" && (summary || run.over)) return { text: "The mission's process ended before the mission did", tone: "bad", reason: "" };
  const failed = failures(run).length;
  if (outcome === "running" && (last(run.held.v) ?? null) !== null) return { text: `The mission is paused${failed ? `, after ${failed === 1 ? "a failure" : `${failed} failures`}` : ""}`, tone: "fair", reason: last(run.held.v) };
  if (outcome === "running" && failed) return { text: `The mission is under way, after ${failed === 1 ? "a failure" : `${failed} failures`}`, tone: "fair", reason: "" };
  const [text, tone] = OUTCOMES[outcome] ?? [`Outcome: ${words(outcome)}`, "now"];
  return { text, tone, reason: reasonTold(run, outcome) ?? (mission.told || summary?.reason || "") };
}

/** What failed, for the outcomes that follow from failures; null: the mission's own reason says it. */
function reasonTold(run, outcome) {
  const causes = ["degraded", "given_up"].includes(outcome) ? answers(run).filter(({ failed }) => failed) : [];
  return causes.map(({ what, t }) => `${what} at ${seconds(t - origin(run), 2)}`).join("; ") || null;
}

/** The figures of the top row: [label, value, hint]. */
function keyFigures(run) {
  const summary = run.facts["/summary"] ?? {};
  const mission = last(run.mission.v) ?? {};
  const figures = [];
  const add = (label, value, unit = "", digits = 1) => {
    if (value !== null && value !== undefined) figures.push([label, typeof value === "number" ? `${fixed(value, digits)}${unit ? ` ${unit}` : ""}` : value]);
  };
  const back = summary.landed ?? (comingBack(run) === null ? null : true);
  const crash = summary.crash && ["no, it crashed", restWhere(run), summary.crash].filter(Boolean).join(": ");
  const came = back ? restWhere(run) || "yes" : back === false ? "no" : null;
  add(robotWords(run).back, crash || [came, summary.left].filter(Boolean).join(": ") || null);
  add(robotWords(run).away, summary.duration_s, "s");
  add(robotWords(run).moved, summary.distance_m, "m");
  const reached = last(run.blackboard.get("waypoints_reached")?.v ?? []) ?? mission.waypoints_reached;
  if (mission.waypoints) add("waypoints reached", `${reached} of ${mission.waypoints}`);
  const tasks = tasksOf(run);
  if (tasks.length) add(`${robotWords(run).tasks} done`, `${tasks.filter(({ done }) => done).length} of ${tasks.length}`);
  add("collisions", summary.collisions, "", 0);
  add("nearest surface", summary.min_clearance_m, "m", 2);
  for (const [path, { label, unit, digits, factor }] of Object.entries(robotWords(run).figures)) {
    const value = path.split(".").reduce((values, name) => values?.[name], summary);
    if (typeof value === "number") add(`${path.includes(".") ? `${path.split(".")[0]} ` : ""}${label}`, factor * value, unit, digits);
  }
  return figures;
}

/** What the mission was sent out for, and what became of it: [{name, done, why}]; known at the end. */
const tasksOf = (run) => run.facts["/summary"]?.tasks ?? [];

/** The pauses of the mission: [{from, to}]; `to` is null in one that lasts. */
function pauses(run) {
  const found = [];
  run.held.v.forEach((held, index) => {
    const open = found.length && last(found).to === null;
    if (held !== null && !open) found.push({ from: run.held.t[index], to: null });
    else if (held === null && open) last(found).to = run.held.t[index];
  });
  return found;
}

/** When the mission was aborted at or after a moment; Infinity: it was not. */
const fateOf = (when, again) => { // undefined: an older record does not tell
  if (again === undefined) return "";
  return again === null ? "; it stayed dead" : `; it ran again${when === null ? "" : ` after ${seconds(again - when)}`}`;
};
const abortAfter = (run, t) => run.operator.find(({ by, command, t: at }) => by === "mission" && command === "abort" && at >= t)?.t ?? Infinity;

const OPERATOR_ACTS = { start: "started the mission", take: "took command", off: "switched everything off" };

/** What happened, a sentence a line: [{t, text, kind}]. */
function account(run) {
  const lines = [];
  const say = (t, text, kind = "") => lines.push({ t, text, kind });
  const recovery = run.facts["/summary"]?.recovery;
  const zero = origin(run);
  if (run.departure !== null) say(run.departure, `${sentence(robotWords(run).departure)}.`);
  for (const { t, until, began, ended } of faultsOf(run)) {
    if (began) say(t, began, "bad"); // of a process that died it is told how, below
    if (until !== null) say(until, ended, "bad");
  }
  operatorTold(run, say);
  for (const { t, text } of noticed(run)) say(t, `${text}.`, "bad");
  for (const { t, text } of controllerActs(run)) say(t, `${sentence(text)}.`, "reaction");
  for (const { t, text, reaction } of failures(run)) {
    say(t, text, "bad");
    if (reaction) say(Math.max(t, reaction.t), `Reaction: ${reaction.text}.`, "reaction");
  }
  if (recovery?.fallback_running_s != null) say(zero + recovery.fallback_running_s, fallbackTold(run, zero + recovery.fallback_running_s), "reaction");
  if (recovery?.moving_again_s != null) say(zero + recovery.moving_again_s, "The robot moves on.", "reaction");
  for (const { name, when_s: when, how, again_s: again } of run.facts["/summary"]?.died ?? []) say(when === null ? run.begin : zero + when, `The process ${name} died: ${how}${fateOf(when, again)}.`, "bad");
  const back = comingBack(run);
  const where = restWhere(run);
  const crash = run.facts["/summary"]?.crash;
  if (back !== null && crash) say(back, `Crashed${where && `, ${where}`}: ${crash}.`, "bad");
  else if (back !== null) say(back, `${sentence(robotWords(run).back)}${where && `, ${where}`}.`);
  const mission = last(run.mission.v);
  const outcome = outcomeOf(run);
  const told = mission?.outcome !== "running" ? mission?.end_s ?? last(run.mission.t) : run.end; // else it was ended
  if (mission && outcome !== "running") say(told, `${OUTCOMES[outcome]?.[0] ?? words(outcome)}.`);
  return lines.sort(byTime);
}

/** Changes of resources that came before a skill failed of them, while the robot was away: [{t, text}]. */
function noticed(run) {
  const ends = failures(run).map(({ t }) => t);
  const changes = new Map(); // those that are a step of several chains count once
  for (const failure of failures(run)) {
    for (const { step, t, text } of failure.chain) if (step === "resource") changes.set(`${t} ${text}`, { t, text });
  }
  return [...changes.values()].filter(({ t }) => t >= (run.departure ?? Infinity) && !ends.some((end) => Math.abs(end - t) <= APART_S));
}

/** Tells what the operator did; of pause, resume and abort what the mission says, where it says something. */
function operatorTold(run, say) {
  const paused = new Set();
  const byMission = new Set(run.operator.filter(({ by }) => by === "mission").map(({ command }) => command));
  for (const act of run.operator) {
    const pause = pauses(run).findIndex(({ from, to }) => from <= act.t && (to === null || act.t < to));
    if (act.by !== "mission") {
      if (byMission.has(act.command)) continue;
      const done = OPERATOR_ACTS[act.command] ?? `asked for: ${act.command}${act.answer ? ` (${act.answer})` : ""}`;
      say(act.t, `The operator ${done}.`);
    } else if (act.command === "paused" && !paused.has(pause)) {
      paused.add(pause); // later ones tell of what has ended meanwhile, which has a line of its own
      say(act.t, `The mission is paused: ${act.reason}.`, "reaction");
    } else if (act.command === "resume") {
      const { from } = pauses(run).findLast(({ to }) => to === act.t) ?? { from: act.t };
      say(act.t, `The mission goes on${from < act.t ? `, after ${seconds(act.t - from)}` : ""}.`, "reaction");
    } else if (act.command === "abort") {
      const then = started(run, act.t, Infinity);
      say(act.t, `${served(run) ? "The run is told to end" : "The mission is told to stop"}: ${act.reason}${then && `; started ${then}`}.`, "reaction");
    }
  }
}

/** Whether the run had no mission, and only served its skills. */
const served = (run) => outcomeOf(run) === "served";

/** A row for each failure, and one for the whole mission: [{what, why, t, until, done, cost, fault, repair}]; the last has no t. */
function answers(run) {
  const rows = [];
  const failed = failures(run);
  const running = outcomeOf(run) === "running";
  const groups = new Map();
  for (const failure of failed) {
    const key = failure.fault ?? failure.key;
    if (!groups.has(key)) groups.set(key, { fault: faultsOf(run)[failure.fault] ?? null, failures: [] });
    groups.get(key).failures.push(failure);
  }
  for (const { fault, failures: own } of groups.values()) rows.push(failureRow(run, fault, own, failed));
  faultsOf(run).forEach(({ text, t, until, detected }, index) => {
    if (!groups.has(index)) rows.push({ what: text, t, until, done: running ? "nothing so far" : detected === null ? "nothing: it was not detected" : "nothing: no skill failed of it", cost: "" });
  });
  for (const { name, when_s: when, how, again_s: again } of run.facts["/summary"]?.died ?? []) {
    const t = when === null ? run.begin : origin(run) + when;
    if (!rows.some((row) => Math.abs(row.t - t) < REACTION_S)) rows.push({ what: `the process ${name} died: ${how}${fateOf(when, again)}`, t, done: "nothing that the record tells of", cost: "" });
  }
  rows.sort(byTime);
  const whole = costs(run);
  if (whole.length) rows.push({ what: served(run) ? "the whole run" : "the whole mission", t: null, done: wholeDone(run), cost: whole.join("; ") });
  return rows;
}

function failureRow(run, fault, own, failed) {
  const [first, final] = [own[0], last(own)];
  const next = failed[failed.indexOf(final) + 1];
  const done = own.map(({ reaction }) => reaction?.text).filter(Boolean);
  const until = Math.min(next?.t ?? Infinity, abortAfter(run, final.t));
  for (const { t, text } of controllerActs(run)) if (t >= first.t - REACTION_S && t < until) done.push(text);
  const later = started(run, final.reacts_until ?? Infinity, until);
  if (later) done.push(`afterwards ${later}`);
  const since = fault?.t ?? first.t;
  const cost = fault ? [`noticed after ${seconds(Math.max(0, (fault.detected ?? first.t) - since), 2)}`] : [];
  const recovery = run.facts["/summary"]?.recovery;
  const answered = failed.find((one) => one.fault !== null) ?? failed[0]; // of two faults at once, the recovery is from the one that failed first
  const recovered = recovery && own.includes(answered) && Math.abs(origin(run) + (recovery.failure_s ?? recovery.detected_s) - since) < 1;
  if (recovered && recovery.fallback_running_s != null) {
    cost.push(`the fallback ran after ${seconds(recovery.fallback_running_s - (recovery.failure_s ?? recovery.detected_s), 2)}`);
    cost.push(...[heldTold(run, origin(run) + recovery.fallback_running_s)].filter(Boolean));
  }
  if (recovered && recovery.moving_again_s != null) cost.push(`the robot moved on after ${seconds(recovery.moving_again_s - (recovery.failure_s ?? recovery.detected_s), 2)}`);
  const endings = own.map(({ text }) => text);
  const what = fault ? fault.text : endings.shift().replace(/\.$/, ""); // each ending is told once
  return { what, why: endings.join(" "), failed: true, t: since, until: fault?.until ?? null, done: done.join("; ") || "nothing followed", cost: cost.join("; "), fault: fault?.name, repair: fault?.repair };
}

/** The skills that were started between two moments, in their order, as "wait, dock"; empty where there are none. */
function started(run, from, to) {
  const found = [...run.executions.values()].filter(({ running }) => running !== null && running > from && running < to);
  return [...new Set(found.map(({ skill }) => skill))].join(", ");
}

/** How the whole mission ended, in a few words. */
function wholeDone(run) {
  const outcome = outcomeOf(run);
  if (outcome === "running") return "";
  const { landed: back, crash, left } = run.facts["/summary"] ?? {};
  const down = crash ? "crashed" : back === true ? robotWords(run).back : back === false ? `not ${robotWords(run).back}` : "";
  return [(OUTCOMES[outcome]?.[0] ?? words(outcome)).toLowerCase(), [down, left].filter(Boolean).join(", ")].filter(Boolean).join("; ");
}

/** What the whole mission lost, a sentence each. */
function costs(run) {
  const summary = run.facts["/summary"];
  const mission = last(run.mission.v) ?? {};
  const lines = [];
  if (mission.waypoints && mission.outcome !== "running") {
    const missed = mission.waypoints - mission.waypoints_reached;
    lines.push(missed ? `${missed} of ${mission.waypoints} waypoints were not reached` : "no waypoint was missed");
  }
  const left = tasksOf(run).filter(({ done }) => !done).length;
  if (left) lines.push(`${left} of ${tasksOf(run).length} ${robotWords(run).tasks} were not done`);
  if (summary?.collisions === 0) lines.push("nothing was hit");
  if (summary?.collisions > 0) lines.push(`${summary.collisions} collisions`);
  return lines;
}

/** Moments that get a line through the timeline: [{t, kind, label}]. */
function marks(run) {
  const zero = origin(run);
  const recovery = run.facts["/summary"]?.recovery;
  const found = faultsOf(run).map(({ t, mark }) => ({ t, kind: "failure", label: mark }));
  if (recovery) {
    const moments = { detected: "detected", fallback_running: "fallback runs", moving_again: "moves again" };
    if (!found.length && recovery.failure_s != null) found.push({ t: zero + recovery.failure_s, kind: "failure", label: "failure" });
    for (const [name, label] of Object.entries(moments)) if (recovery[`${name}_s`] != null) found.push({ t: zero + recovery[`${name}_s`], kind: name, label });
  } else for (const { t, skill } of failures(run)) found.push({ t, kind: "detected", label: `${skill} failed` });
  for (const { from, to } of pauses(run)) found.push({ t: from, kind: "pause", label: "paused" }, ...(to === null ? [] : [{ t: to, kind: "pause", label: "goes on" }]));
  return found.sort(byTime);
}
