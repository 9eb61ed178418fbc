// What happened, in words: the outcome, what failed, what was done about it and what it cost; and each failure's chain of causes.

const OUTCOMES = {
  accomplished: ["Mission accomplished", "good"],
  degraded: ["Mission accomplished in degraded mode", "fair"],
  given_up: ["Mission given up", "bad"],
  aborted: ["Mission aborted by the operator", "bad"],
  not_started: ["The mission did not start", "bad"],
  running: ["The mission is under way", "now"],
};

const APART_S = 0.1; // an event's stamp may be some ticks of the clock older than what caused it
const REACTION_S = 3; // how long after a failure the tree's reaction is looked for

function headline(run) {
  const mission = last(run.mission.v) ?? {};
  const summary = run.facts["/summary"];
  if (run.begin === null) return { text: run.facts["/run"] ? "The run has recorded nothing yet" : "No run yet", tone: "now", reason: "" };
  const outcome = summary?.outcome ?? mission.outcome ?? "running";
  if (summary && outcome === "running") return { text: "The mission's process ended before the mission did", tone: "bad", reason: "" };
  const failed = failures(run).length;
  if (outcome === "running" && (last(run.held.v) ?? null) !== null) return { text: `The mission is paused${failed ? `, after ${failed === 1 ? "a failure" : `${failed} failures`}` : ""}`, tone: "fair", reason: last(run.held.v) };
  if (outcome === "running" && failed) return { text: `The mission is under way, after ${failed === 1 ? "a failure" : `${failed} failures`}`, tone: "fair", reason: "" };
  const [text, tone] = OUTCOMES[outcome] ?? [`Outcome: ${words(outcome)}`, "now"];
  return { text, tone, reason: summary?.reason ?? mission.reason ?? "" };
}

/** The figures of the top row: [label, value, hint]. */
function keyFigures(run) {
  const summary = run.facts["/summary"] ?? {};
  const mission = last(run.mission.v) ?? {};
  const figures = [];
  const add = (label, value, unit = "", digits = 1) => {
    if (value !== null && value !== undefined) figures.push([label, typeof value === "number" ? `${fixed(value, digits)}${unit ? ` ${unit}` : ""}` : value]);
  };
  add("landed", summary.landed === true ? "yes" : summary.landed === false ? "no" : null);
  add("in the air", summary.duration_s, "s");
  add("flown", summary.distance_m, "m");
  const reached = last(run.blackboard.get("waypoints_reached")?.v ?? []) ?? mission.waypoints_reached;
  if (mission.waypoints) add("waypoints reached", `${reached} of ${mission.waypoints}`);
  add("collisions", summary.collisions, "", 0);
  add("nearest surface", summary.min_clearance_m, "m", 2);
  add("map coverage", summary.map?.coverage != null ? 100 * summary.map.coverage : null, "%");
  add("map error (RMS)", summary.map?.rmse_m, "m", 3);
  add("least picture quality (SSIM)", summary.video?.min_ssim, "", 2);
  add("least frame rate", summary.video?.min_fps, "1/s", 0);
  return figures;
}

/** Executions that ended badly, in the order of their ends. */
function failures(run) {
  return [...run.executions.values()]
    .filter((execution) => ["violated", "failure"].includes(endingOf(execution)))
    .sort((one, other) => one.end - other.end);
}

/** What was made to fail: live nobody tells before the summary does. */
function faultsOf(run) {
  if (run.faults.length) return run.faults;
  return (run.facts["/summary"]?.injected ?? []).filter(({ t_s: since }) => since !== null).map(({ sensor, mode, t_s: since }) => ({ sensor, mode, t: origin(run) + since }));
}

/** A failure's chain of causes: [{step, t, text}], from the measurement to what the tree did. */
function chainOf(run, failure) {
  const chain = [];
  const add = (step, t, text) => chain.push({ step, t, text });
  const change = blamed(run, failure);
  const sensor = change ? change.resource.replace(/_status$/, "") : "";
  const fault = faultsOf(run).findLast((entry) => entry.t <= failure.end + APART_S && entry.mode !== "ok" && (entry.sensor === sensor || failure.message.includes(entry.sensor)));
  if (fault) add("failure", fault.t, `${fault.sensor}: ${fault.mode} (injected)`);
  const measured = measurement(run, failure, sensor);
  if (measured) add("measurement", measured.t, measured.text);
  if (change) add("resource", change.t, `${change.name}: ${change.from} → ${change.state}${change.cause === "extern" ? ", reported by the functional layer" : ` (${change.cause})`}`);
  const why = failure.message || failure.result || words(failure.state);
  if (endingOf(failure) === "violated") add("invariant", failure.end, `${failure.result} of ${failure.skill}: ${why.replace(`${failure.result}: `, "")}`);
  add("skill", failure.end, `${failure.skillset}.${failure.skill} ended: ${endingOf(failure) === "violated" ? "invariant violated" : `${words(failure.state)} ${failure.result}`.trim()}`);
  return [...chain, ...branchOf(run, failure), ...reactionOf(run, failure)];
}

/** The last change, before a failure, of a resource that its message names. */
function blamed(run, failure) {
  let found = null;
  for (const [name, track] of run.resources) {
    const resource = name.split(".")[1];
    if (!failure.message.includes(resource)) continue;
    const index = indexAt(track.t, failure.end + APART_S);
    if (index > 0 && (!found || track.t[index] > found.t)) found = { name, resource, t: track.t[index], ...track.v[index] };
  }
  return found;
}

function measurement(run, failure, sensor) {
  const track = run.health.get(sensor);
  if (track) {
    const index = indexAt(track.t, failure.end + APART_S);
    if (index >= 0 && !track.v[index].ok) return { t: track.t[index], text: `${sensor} is ${track.v[index].fault || "not fine"}: ${track.v[index].reason}` };
  }
  for (const [name, samples] of run.data) {
    const data = name.split(".")[1];
    const named = [...samples.columns.keys()].filter((column) => failure.message.includes(`${data}.${column}`)).sort((one, other) => other.length - one.length)[0];
    const index = indexAt(samples.t, failure.end + APART_S);
    if (named && index >= 0) return { t: samples.t[index], text: `${data}.${named} is ${short(samples.columns.get(named)[index])}` };
  }
  return null;
}

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

/** Until when a failure's reaction is looked for: a mission that is paused then reacts when it goes on. */
function reactsUntil(run, t) {
  const pause = pauses(run).find(({ from, to }) => from <= t && (to === null || t < to));
  return (pause ? pause.to ?? Infinity : t) + REACTION_S;
}

/** The branch that a failure took down, and the one that the tree went on with. */
function branchOf(run, failure) {
  const until = reactsUntil(run, failure.end);
  const tree = treeAt(run, until);
  const leaf = tree?.nodes.find((node) => node.skill === `${failure.skillset}.${failure.skill}` && failedAround(node, failure.end, until) !== null);
  if (!leaf) return [];
  let top = leaf;
  while (top.parent && failedAround(top.parent, failure.end, until) !== null) top = top.parent;
  const chain = [{ step: "branch", t: failedAround(top, failure.end, until) ?? failure.end, text: `“${top.name}” failed` }];
  const siblings = top.parent?.children ?? [];
  const next = siblings.slice(siblings.indexOf(top) + 1).find((node) => node.track.v.some(({ status }) => status !== "INVALID"));
  if (next && top.parent.kind === "selector") {
    const index = next.track.v.findIndex(({ status }) => status !== "INVALID");
    const t = next.track.t[index] <= until ? Math.max(failure.end, next.track.t[index]) : failure.end;
    chain.push({ step: "decision", t, text: `“${top.parent.name}” went on with “${next.name}”` });
  } else if (!top.parent) chain.push({ step: "decision", t: failure.end, text: "nothing was left to try" });
  return chain;
}

/** When a node became FAILURE between t and another moment; of a tree that was seen only once, then. Null: it did not. */
function failedAround(node, t, until) {
  const { track } = node;
  const index = track.v.findIndex(({ status }, at) => status === "FAILURE" && track.t[at] >= t - APART_S && track.t[at] <= until);
  if (index >= 0) return track.t[index];
  return track.v.length === 1 && track.v[0].status === "FAILURE" ? t : null;
}

/** Skills that were interrupted for a failure's sake, and those that were started. */
function reactionOf(run, failure) {
  const chain = [];
  const until = reactsUntil(run, failure.end);
  const near = (t) => t !== null && t >= failure.end - APART_S && t <= until;
  const others = [...run.executions.values()].filter((execution) => execution !== failure);
  const stopped = others.filter((execution) => execution.state === "INTERRUPTED" && near(execution.end) && execution.start < failure.end);
  const started = others.filter((execution) => near(execution.running) && execution.start >= failure.end - APART_S);
  if (stopped.length) chain.push({ step: "stopped", t: stopped[0].end, text: `interrupted: ${stopped.map(({ skill }) => skill).join(", ")}` });
  if (started.length) chain.push({ step: "started", t: started[0].running, text: `started: ${[...new Set(started.map(({ skill }) => skill))].join(", ")}` });
  return chain.sort((one, other) => one.t - other.t);
}

/** What happened, a sentence a line: [{t, text, kind}]. */
function story(run) {
  const lines = [];
  const say = (t, text, kind = "") => lines.push({ t, text, kind });
  const recovery = run.facts["/summary"]?.recovery;
  const zero = origin(run);
  if (run.departure !== null) say(run.departure, "Lift-off.");
  for (const fault of faultsOf(run)) say(fault.t, fault.mode === "ok" ? `The ${fault.sensor} works again.` : `The ${fault.sensor} was made to fail (${fault.mode}).`, "bad");
  for (const failure of failures(run)) {
    const chain = chainOf(run, failure);
    const branch = chain.find(({ step }) => step === "decision");
    const acts = chain.filter(({ step }) => ["stopped", "started"].includes(step));
    const done = acts.map(({ text }) => text.replace(":", "")).join("; ");
    const why = (failure.message || failure.result).replace(/, after .*$/, "");
    say(failure.end, `${failure.skillset}.${failure.skill} ${ENDINGS[endingOf(failure)].words}${why ? `: ${why}` : ""}.`, "bad");
    const reaction = [branch?.text, done].filter(Boolean).join("; ");
    if (reaction) say(Math.max(failure.end, (branch ?? acts[0]).t), `Reaction: ${reaction}.`, "reaction");
  }
  if (recovery?.fallback_running_s != null) say(zero + recovery.fallback_running_s, "The fallback watches: the flight is safe again.", "reaction");
  if (recovery?.moving_again_s != null) say(zero + recovery.moving_again_s, "The vehicle moves on.", "reaction");
  for (const { name, when_s: when, how } of run.facts["/summary"]?.died ?? []) say(when === null ? run.begin : zero + when, `The process ${name} died: ${how}.`, "bad");
  const paused = new Set();
  for (const act of run.operator) {
    const pause = pauses(run).findIndex(({ from, to }) => from <= act.t && (to === null || act.t < to));
    if (act.by !== "mission") say(act.t, `The operator: ${act.command}.`);
    else if (act.command === "paused" && !paused.has(pause)) {
      paused.add(pause); // later ones tell of what has ended meanwhile, which has a line of its own
      say(act.t, `The mission is paused: ${act.reason}.`, "reaction");
    }
    else if (act.command === "resume") say(act.t, "The mission goes on.", "reaction");
    else if (act.command === "abort") say(act.t, `The mission is told to stop: ${act.reason}.`, "reaction");
  }
  const mission = last(run.mission.v);
  if (mission && mission.outcome !== "running") say(mission.end_s ?? last(run.mission.t), `${OUTCOMES[mission.outcome]?.[0] ?? words(mission.outcome)}.`);
  return lines.sort((one, other) => one.t - other.t);
}

/** What the failures cost, a sentence each. */
function costs(run) {
  const summary = run.facts["/summary"];
  const recovery = summary?.recovery;
  const mission = last(run.mission.v) ?? {};
  const lines = [];
  if (recovery?.failure_s != null && recovery.detected_s != null) lines.push(`${seconds(recovery.detected_s - recovery.failure_s, 2)} from the failure to its detection`);
  if (recovery?.fallback_running_s != null) lines.push(`${seconds(recovery.fallback_running_s - (recovery.failure_s ?? recovery.detected_s), 2)} from the failure until the fallback watched`);
  if (recovery?.moving_again_s != null) lines.push(`${seconds(recovery.moving_again_s - (recovery.failure_s ?? recovery.detected_s), 2)} from the failure until the vehicle moved on`);
  if (mission.waypoints && mission.outcome !== "running") {
    const missed = mission.waypoints - mission.waypoints_reached;
    lines.push(missed ? `${missed} of ${mission.waypoints} waypoints were not reached` : "no waypoint was missed");
  }
  for (const { from, to } of pauses(run)) if (to !== null) lines.push(`${seconds(to - from)} paused; what failed meanwhile was dealt with afterwards`);
  if (summary?.outcome === "degraded") lines.push("the rest of the mission was flown in degraded mode");
  if (summary?.outcome === "given_up") lines.push("the mission's aim was given up");
  if (summary?.collisions === 0) lines.push("nothing was hit");
  return lines;
}

/** Moments that get a line through the timeline: [{t, kind, label}]. */
function marks(run) {
  const zero = origin(run);
  const recovery = run.facts["/summary"]?.recovery;
  const found = faultsOf(run).filter(({ mode }) => mode !== "ok").map((fault) => ({ t: fault.t, kind: "failure", label: `${fault.sensor} fails` }));
  if (recovery) {
    const moments = { detected: "detected", fallback_running: "fallback runs", moving_again: "moves again" };
    if (!found.length && recovery.failure_s != null) found.push({ t: zero + recovery.failure_s, kind: "failure", label: "failure" });
    for (const [name, label] of Object.entries(moments)) if (recovery[`${name}_s`] != null) found.push({ t: zero + recovery[`${name}_s`], kind: name, label });
  } else for (const failure of failures(run)) found.push({ t: failure.end, kind: "detected", label: `${failure.skill} ${endingOf(failure)}` });
  for (const { from, to } of pauses(run)) found.push({ t: from, kind: "pause", label: "paused" }, ...(to === null ? [] : [{ t: to, kind: "pause", label: "goes on" }]));
  return found.sort((one, other) => one.t - other.t);
}
