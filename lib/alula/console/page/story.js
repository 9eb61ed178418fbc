// What happened, in words: the outcome; a row a failure with what was done and what it cost; each failure's chain of causes.

const OUTCOMES = {
  accomplished: ["Mission accomplished", "good"],
  degraded: ["Mission accomplished in degraded mode", "fair"],
  given_up: ["Mission given up", "bad"],
  aborted: ["Mission aborted", "bad"],
  not_started: ["The mission did not start", "bad"],
  running: ["The mission is under way", "now"],
};

const APART_S = 0.1; // an event's stamp may be some ticks of the clock older than what caused it
const DIED = "died"; // the way of failing of a process that ended without being told to
const SAME_S = 1; // a fault of the radio and what the recordings tell of it are no farther apart
const REACTION_S = 3; // how long after a failure the tree's reaction is looked for

function headline(run) {
  const mission = last(run.mission.v) ?? {};
  const summary = run.facts["/summary"];
  if (run.begin === null && run.mission.v.length) return { text: "The mission waits for its clock", tone: "now", reason: "" };
  if (run.begin === null) return { text: run.facts["/run"] ? "The run has recorded nothing yet" : "No run yet", tone: "now", reason: "" };
  const outcome = summary?.outcome ?? mission.outcome ?? "running";
  if (outcome === "running" && (summary || run.over)) return { text: "The mission's process ended before the mission did", tone: "bad", reason: "" };
  const failed = failures(run).length;
  if (outcome === "running" && (last(run.held.v) ?? null) !== null) return { text: `The mission is paused${failed ? `, after ${failed === 1 ? "a failure" : `${failed} failures`}` : ""}`, tone: "fair", reason: last(run.held.v) };
  if (outcome === "running" && failed) return { text: `The mission is under way, after ${failed === 1 ? "a failure" : `${failed} failures`}`, tone: "fair", reason: "" };
  const [text, tone] = OUTCOMES[outcome] ?? [`Outcome: ${words(outcome)}`, "now"];
  return { text, tone, reason: reasonTold(run, outcome) ?? reasonInWords(summary?.reason ?? mission.reason ?? "") };
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
  const landed = summary.landed ?? (landing(run) === null ? null : true);
  const crash = summary.crash && ["no, it crashed", landedWhere(run), summary.crash].filter(Boolean).join(": ");
  add("landed", crash || (landed ? landedWhere(run) || "yes" : landed === false ? "no" : null));
  add("in the air", summary.duration_s, "s");
  add("flown", summary.distance_m, "m");
  const reached = last(run.blackboard.get("waypoints_reached")?.v ?? []) ?? mission.waypoints_reached;
  if (mission.waypoints) add("waypoints reached", `${reached} of ${mission.waypoints}`);
  add("collisions", summary.collisions, "", 0);
  add("nearest surface", summary.min_clearance_m, "m", 2);
  add("map coverage", summary.map?.coverage != null ? 100 * summary.map.coverage : null, "%");
  add("map error (RMS)", summary.map?.rmse_m, "m", 3);
  add("least picture quality (SSIM)", summary.video?.min_ssim, "", 2);
  add("least frame rate", summary.video?.min_fps, "frames/s", 0);
  return figures;
}

/** Executions that ended badly, in the order of their ends. */
function failures(run) {
  return [...run.executions.values()]
    .filter((execution) => ["violated", "failure"].includes(endingOf(execution)))
    .sort((one, other) => byTime({ t: one.end }, { t: other.end }));
}

/** Every change of something that failed: [{sensor, mode, t, itself}], `ok` being the mode in which it works. */
function faultsOf(run) {
  const made = madeToFail(run);
  return [...made, ...failedItself(run, made)].sort(byTime);
}

/** What failed by itself: processes that died, and the radio that was lost. Only a summary knows of them. */
function failedItself(run, made) {
  const known = (run.facts["/summary"]?.answers ?? []).filter(({ t_s: since }) => since !== null).map(({ sensor, mode, t_s: since, until_s: until }) => ({ sensor, mode, t: origin(run) + since, until, itself: true }));
  const own = known.filter((fault) => !made.some((one) => sameFault(one, fault)));
  return own.flatMap((fault) => [fault, ...(fault.until == null ? [] : [{ ...fault, mode: "ok", t: origin(run) + fault.until }])]);
}

const sameFault = (one, other) => one.sensor === other.sensor && Math.abs(one.t - other.t) < SAME_S;

/** What was made to fail, as the recordings or the summary tell; of what neither tells, as the radio or while the flight goes on, what was asked for. */
function madeToFail(run) {
  const summed = (run.facts["/summary"]?.injected ?? []).filter(({ t_s: since }) => since !== null).map(({ sensor, mode, t_s: since }) => ({ sensor, mode, t: origin(run) + since }));
  const told = run.faults.length ? run.faults : summed;
  const asked = (run.facts["/run"]?.faults ?? []).flatMap((text) => requested(run, String(text))).filter(({ sensor }) => !told.some((one) => one.sensor === sensor));
  return [...told, ...asked];
}

/** What a request such as radio:critical@40-50 has come to by now: [{sensor, mode, t}]; the mode is empty where none was asked for. */
function requested(run, text) {
  const found = /^(\w+)(?::(\w+))?(?:@([\d.]+)(?:-([\d.]+))?)?$/.exec(text);
  if (!found || run.begin === null) return [];
  const [, sensor, mode = "", from, until] = found;
  const flew = run.departure !== null || run.facts["/summary"]?.lift_off != null;
  const at = (since) => (since === undefined || !flew ? Infinity : origin(run) + Number(since));
  const faults = [{ sensor, mode, t: from === undefined ? run.begin : at(from) }, { sensor, mode: "ok", t: at(until) }];
  return faults.filter(({ t }) => t <= run.end);
}

/** The name of what fails, for a sentence. */
const named = (sensor) => String(sensor).replaceAll("_", " ");

/** What failed, in words; mocks do not tell in which way something fails. */
function faultWords({ sensor, mode, itself }) {
  if (itself) return mode === DIED ? `the process ${sensor} died` : `${named(sensor)} was lost`;
  return `${named(sensor)} failed (${mode && mode !== "mock" ? `${mode}, ` : ""}injected)`;
}

/** What a summary tells of a fault: when it was detected, what failed because of it; undefined while there is no summary of it. */
const answerTo = (run, fault) => run.facts["/summary"]?.answers?.find(({ sensor, t_s: since }) => sameFault({ sensor, t: origin(run) + since }, fault));

/** The failure that was made behind an execution that ended badly, null without one: in a summary the one that it follows from (`sure`). Without a summary the one that it names (`sure`), else the last one before. */
function faultBehind(run, failure) {
  if (run.facts["/summary"]?.answers) {
    const fault = faultsOf(run).find((one) => one.mode !== "ok" && answerTo(run, one)?.failed.includes(failure.id));
    return fault ? { ...fault, sure: true } : null;
  }
  const before = faultsOf(run).filter(({ t, mode }) => t <= failure.end + APART_S && mode !== "ok");
  const sensor = blamed(run, failure)?.resource.replace(/_status$/, "");
  const own = before.findLast((fault) => fault.sensor === sensor || failure.message.includes(fault.sensor));
  const fault = own ?? last(before);
  return fault ? { ...fault, sure: Boolean(own) } : null;
}

const chains = new WeakMap(); // failure -> {key, chain}

/** A failure's chain of causes: [{step, t, text}], in the order of time, from the fault to what the tree did; made again only while something may be added. */
function chainOf(run, failure) {
  const settled = run.end > reactsUntil(run, failure.end);
  const key = `${faultsOf(run).length} ${run.facts["/summary"] !== undefined} ${settled || run.news}`;
  if (chains.get(failure)?.key !== key) chains.set(failure, { key, chain: makeChain(run, failure) });
  return chains.get(failure).chain;
}

function makeChain(run, failure) {
  const chain = [];
  const add = (step, t, text) => chain.push({ step, t: Math.min(t, failure.end), text }); // a cause is stamped some ticks late at most
  const change = blamed(run, failure);
  const sensor = change ? change.resource.replace(/_status$/, "") : "";
  const fault = faultBehind(run, failure);
  if (fault) add(fault.sure ? "failure" : "before", fault.t, faultWords(fault));
  const measured = measurement(run, failure, sensor || (fault?.sure ? fault.sensor : ""));
  if (measured) add("measurement", measured.t, measured.text);
  const told = fault && !change ? answerTo(run, fault) : undefined;
  if (told?.detected_by.includes(" -> ")) add("resource", origin(run) + told.detected_s, `${told.detected_by.replace(" ", ": ").replace("->", "→")}, reported by the functional layer`);
  if (change) add("resource", change.t, `${change.name}: ${change.from} → ${change.state}${change.cause === "extern" ? ", reported by the functional layer" : ` (${change.cause})`}`);
  const why = failure.message || failure.result || words(failure.state);
  if (endingOf(failure) === "violated") add("invariant", failure.end, `${failure.result} of ${failure.skill}: ${inWords(why.replace(`${failure.result}: `, ""))}`);
  add("skill", failure.end, `${failure.skillset}.${failure.skill} ended: ${endingOf(failure) === "violated" ? "invariant violated" : `${words(failure.state)} ${failure.result}`.trim()}`);
  const effects = [...branchOf(run, failure), ...reactionOf(run, failure)].map((one) => ({ ...one, t: Math.max(one.t, failure.end) })); // and an effect early
  return [...chain, ...effects].sort(byTime);
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
    const column = [...samples.columns.keys()].filter((name_) => failure.message.includes(`${data}.${name_}`)).sort((one, other) => other.length - one.length)[0];
    const index = indexAt(samples.t, failure.end + APART_S);
    const value = column && samples.columns.get(column)[index];
    if (["number", "string", "boolean"].includes(typeof value)) return { t: samples.t[index], text: inWords(`${data}.${column} is ${short(value)}`) };
  }
  return null;
}

/** How an execution ended, a sentence. */
function endingTold(failure) {
  const name = `${failure.skillset}.${failure.skill}`;
  const why = inWords((failure.message || "").replace(/, after .*$/, "").replace(`${failure.result}: `, ""));
  const because = why ? `: ${why}` : failure.result ? `: ${failure.result}` : "";
  if (endingOf(failure) === "violated") return `${name} was stopped, its invariant ${failure.result} was violated${why ? `: ${why}` : ""}.`;
  if (failure.state === "NOT_READY") return `${name} could not start, its precondition ${failure.result} was not met${why ? `: ${why}` : ""}.`;
  if (failure.state === "NOT_VALIDATED") return `${name} was refused${because}.`;
  return `${name} failed${because}.`;
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

/** Until when a failure's reaction is looked for: a mission that is paused then reacts when it goes on; what follows an abort is the abort's. */
function reactsUntil(run, t) {
  const pause = pauses(run).find(({ from, to }) => from <= t && (to === null || t < to));
  return Math.min((pause ? pause.to ?? Infinity : t) + REACTION_S, abortAfter(run, t) - 0.001);
}

/** When the mission was aborted at or after a moment; Infinity: it was not. */
const abortAfter = (run, t) => run.operator.find(({ by, command, t: at }) => by === "mission" && command === "abort" && at >= t)?.t ?? Infinity;

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
  const later = siblings.slice(siblings.indexOf(top) + 1).filter((node) => node.track.v.some(({ status }) => status !== "INVALID"));
  const answer = run.facts["/summary"]?.answers?.find(({ failed }) => failed.includes(failure.id))?.answered_by;
  const next = later.find(({ name }) => name === answer) ?? later[0]; // one that was tried and failed at once answered nothing
  if (next && top.parent.kind === "selector") {
    const index = next.track.v.findIndex(({ status }) => status !== "INVALID");
    const t = next.track.t[index] <= until ? Math.max(failure.end, next.track.t[index]) : failure.end;
    chain.push({ step: "decision", t, text: `“${top.parent.name}” went on with “${next.name}”`, told: `the mission fell back from “${top.name}” to “${next.name}”` });
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
  const earlier = failures(run).filter((other) => other.end < failure.end);
  const near = (t) => t !== null && t >= failure.end - APART_S && t <= until && (t >= failure.end || !earlier.some((other) => t >= other.end - APART_S));
  const others = [...run.executions.values()].filter((execution) => execution !== failure);
  const stopped = others.filter((execution) => execution.state === "INTERRUPTED" && near(execution.end) && execution.start < failure.end);
  const started = others.filter((execution) => near(execution.running) && execution.start >= failure.end - APART_S);
  if (stopped.length) chain.push({ step: "stopped", t: stopped[0].end, text: `interrupted: ${stopped.map(({ skill }) => skill).join(", ")}` });
  if (started.length) chain.push({ step: "started", t: started[0].running, text: `started: ${[...new Set(started.map((one) => `${one.skill}${one.skill === failure.skill && one.skillset === failure.skillset ? " again" : ""}`))].join(", ")}` });
  return chain.sort(byTime);
}

/** What the mission did about a failure: {t, text}, or null where nothing followed. */
function reactionTold(chain) {
  const steps = chain.filter(({ step }) => ["decision", "stopped", "started"].includes(step));
  if (!steps.length) return null;
  const texts = steps.map(({ text, told }) => told ?? text.replace(":", ""));
  return { t: steps[0].t, text: texts.join("; ") };
}

const OPERATOR_ACTS = { start: "started the mission", take: "took command", off: "switched everything off" };

/** What happened, a sentence a line: [{t, text, kind}]. */
function story(run) {
  const lines = [];
  const say = (t, text, kind = "") => lines.push({ t, text, kind });
  const recovery = run.facts["/summary"]?.recovery;
  const zero = origin(run);
  if (run.departure !== null) say(run.departure, "Lift-off.");
  for (const { sensor, mode, t, itself } of faultsOf(run)) {
    if (mode === DIED) continue; // told with how it died, below
    const failed = itself ? "was lost" : `was made to fail${mode && mode !== "mock" ? ` (${mode})` : ""}`;
    say(t, `The ${named(sensor)} ${mode === "ok" ? "works again" : failed}.`, "bad");
  }
  operatorTold(run, say);
  for (const { t, text } of noticed(run)) say(t, `${text}.`, "bad");
  for (const { t, text } of autopilotActs(run)) say(t, `The autopilot ${text}.`, "reaction");
  for (const failure of failures(run)) {
    say(failure.end, endingTold(failure), "bad");
    const reaction = reactionTold(chainOf(run, failure));
    if (reaction) say(Math.max(failure.end, reaction.t), `Reaction: ${reaction.text}.`, "reaction");
  }
  if (recovery?.fallback_running_s != null) say(zero + recovery.fallback_running_s, fallbackTold(run, zero + recovery.fallback_running_s), "reaction");
  if (recovery?.moving_again_s != null) say(zero + recovery.moving_again_s, "The vehicle moves on.", "reaction");
  for (const { name, when_s: when, how } of run.facts["/summary"]?.died ?? []) say(when === null ? run.begin : zero + when, `The process ${name} died: ${how}.`, "bad");
  const landed = landing(run);
  const where = landedWhere(run);
  const crash = run.facts["/summary"]?.crash;
  if (landed !== null && crash) say(landed, `Crashed${where && `, ${where}`}: ${crash}.`, "bad");
  else if (landed !== null) say(landed, `Landed${where && `, ${where}`}.`);
  const mission = last(run.mission.v);
  if (mission && mission.outcome !== "running") say(mission.end_s ?? last(run.mission.t), `${OUTCOMES[mission.outcome]?.[0] ?? words(mission.outcome)}.`);
  return lines.sort(byTime);
}

/** Changes of resources that came before a skill failed of them, in the air: [{t, text}]. */
function noticed(run) {
  const ends = failures(run).map(({ end }) => end);
  const changes = new Map(); // those that are a step of several chains count once
  for (const failure of failures(run)) {
    for (const { step, t, text } of chainOf(run, failure)) if (step === "resource") changes.set(`${t} ${text}`, { t, text });
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
      say(act.t, `The mission is told to stop: ${act.reason}${then && `; started ${then}`}.`, "reaction");
    }
  }
}

/** A row for each failure, and one for the whole mission: [{what, why, t, until, done, cost}]; the last has no t. */
function answers(run) {
  const rows = [];
  const failed = failures(run);
  const running = (run.facts["/summary"]?.outcome ?? last(run.mission.v)?.outcome ?? "running") === "running";
  const groups = new Map();
  for (const failure of failed) {
    const fault = faultBehind(run, failure);
    const key = fault ? `${fault.sensor} ${fault.t}` : `${failure.id} ${failure.end}`;
    if (!groups.has(key)) groups.set(key, { fault, failures: [] });
    groups.get(key).failures.push(failure);
  }
  for (const { fault, failures: own } of groups.values()) rows.push(failureRow(run, fault, own, failed));
  for (const fault of faultsOf(run)) if (fault.mode !== "ok" && !groups.has(`${fault.sensor} ${fault.t}`)) rows.push({ what: faultWords(fault), t: fault.t, until: endOf(run, fault), done: running ? "nothing so far" : answerTo(run, fault)?.answered_by === "not detected" ? "nothing: it was not detected" : "nothing: no skill failed of it", cost: "" });
  for (const { name, when_s: when, how } of run.facts["/summary"]?.died ?? []) {
    const t = when === null ? run.begin : origin(run) + when;
    if (!rows.some((row) => Math.abs(row.t - t) < REACTION_S)) rows.push({ what: `the process ${name} died: ${how}`, t, done: "nothing that the record tells of", cost: "" });
  }
  rows.sort(byTime);
  const whole = costs(run);
  if (whole.length) rows.push({ what: "the whole mission", t: null, done: wholeDone(run), cost: whole.join("; ") });
  return rows;
}

/** When what was made to fail was made to work again; null: it was not. */
const endOf = (run, fault) => faultsOf(run).find(({ sensor, mode, t }) => sensor === fault.sensor && mode === "ok" && t > fault.t)?.t ?? null;

function failureRow(run, fault, own, failed) {
  const [first, final] = [own[0], last(own)];
  const next = failed[failed.indexOf(final) + 1];
  const done = own.map((failure) => reactionTold(chainOf(run, failure))?.text).filter(Boolean);
  const until = Math.min(next?.end ?? Infinity, abortAfter(run, final.end));
  for (const { t, text } of autopilotActs(run)) if (t >= own[0].end - REACTION_S && t < until) done.push(`the autopilot ${text}`);
  const later = started(run, reactsUntil(run, final.end), until);
  if (later) done.push(`afterwards ${later}`);
  const since = fault?.t ?? first.end;
  const cost = [];
  const noticed = fault ? answerTo(run, fault)?.detected_s : null;
  if (fault) cost.push(`noticed after ${seconds(Math.max(0, (noticed == null ? first.end : origin(run) + noticed) - since), 2)}`);
  const recovery = run.facts["/summary"]?.recovery;
  const answered = failed.find((one) => faultBehind(run, one)) ?? failed[0]; // of two faults at once, the recovery is from the one that failed first
  const recovered = recovery && own.includes(answered) && Math.abs(origin(run) + (recovery.failure_s ?? recovery.detected_s) - since) < 1;
  if (recovered && recovery.fallback_running_s != null) {
    cost.push(`the fallback ran after ${seconds(recovery.fallback_running_s - (recovery.failure_s ?? recovery.detected_s), 2)}`);
    cost.push(...[heldTold(run, origin(run) + recovery.fallback_running_s)].filter(Boolean));
  }
  if (recovered && recovery.moving_again_s != null) cost.push(`the vehicle moved on after ${seconds(recovery.moving_again_s - (recovery.failure_s ?? recovery.detected_s), 2)}`);
  const endings = own.map((failure) => endingTold(failure));
  const what = fault ? faultWords(fault) : endings.shift().replace(/\.$/, ""); // each ending is told once
  return { what, why: endings.join(" "), failed: true, t: since, until: fault ? endOf(run, fault) : null, done: done.join("; ") || "nothing followed", cost: cost.join("; ") };
}

/** The skills that were started between two moments, in their order, as "hover, land"; empty where there are none. */
function started(run, from, to) {
  const found = [...run.executions.values()].filter(({ running }) => running !== null && running > from && running < to);
  return [...new Set(found.map(({ skill }) => skill))].join(", ");
}

/** How the whole mission ended, in a few words. */
function wholeDone(run) {
  const outcome = run.facts["/summary"]?.outcome ?? last(run.mission.v)?.outcome;
  if (!outcome || outcome === "running") return "";
  const { landed: on, crash } = run.facts["/summary"] ?? {};
  const down = crash ? "crashed" : on === true ? "landed" : on === false ? "not landed" : "";
  return [(OUTCOMES[outcome]?.[0] ?? words(outcome)).toLowerCase(), down].filter(Boolean).join("; ");
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
  if (summary?.collisions === 0) lines.push("nothing was hit");
  if (summary?.collisions > 0) lines.push(`${summary.collisions} collisions`);
  return lines;
}

/** Moments that get a line through the timeline: [{t, kind, label}]. */
function marks(run) {
  const zero = origin(run);
  const recovery = run.facts["/summary"]?.recovery;
  const found = faultsOf(run).filter(({ mode }) => mode !== "ok").map(({ sensor, mode, t, itself }) => ({ t, kind: "failure", label: `${sensor} ${!itself ? "fails" : mode === DIED ? "died" : "lost"}` }));
  if (recovery) {
    const moments = { detected: "detected", fallback_running: "fallback runs", moving_again: "moves again" };
    if (!found.length && recovery.failure_s != null) found.push({ t: zero + recovery.failure_s, kind: "failure", label: "failure" });
    for (const [name, label] of Object.entries(moments)) if (recovery[`${name}_s`] != null) found.push({ t: zero + recovery[`${name}_s`], kind: name, label });
  } else for (const failure of failures(run)) found.push({ t: failure.end, kind: "detected", label: `${failure.skill} ${endingOf(failure)}` });
  for (const { from, to } of pauses(run)) found.push({ t: from, kind: "pause", label: "paused" }, ...(to === null ? [] : [{ t: to, kind: "pause", label: "goes on" }]));
  return found.sort(byTime);
}
