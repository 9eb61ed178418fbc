// Manual control, on the live page: any skillset of the run by its description. Resources with the transitions that are possible now, skills
// with their inputs, why one can't start now, what runs and how it last ended. Starts and transitions take two presses; managers decide.

class ManualControlView {
  constructor(send, armed) {
    [this.send, this.armed] = [send, armed];
    [this.root, this.skill, this.texts, this.shown, this.may] = ["", "", new Map(), null, false];
    this.box = byId("manual");
    this.box.hidden = false;
    this.box.addEventListener("toggle", () => this.look());
    this.tabs = el("div", { class: "acts", role: "group", "aria-label": "skillset" });
    this.list = el("ul", { class: "skills", "aria-label": "skills" });
    this.form = el("form", { class: "skill", onsubmit: (event) => event.preventDefault() });
    this.resources = el("ul", { class: "resources", "aria-label": "resources" });
    this.data = el("ul", { class: "hand-data", "aria-label": "data" });
    this.answer = el("output", { role: "status" });
    this.note = el("p", { class: "hint" });
    byId("manual-body").append(this.tabs, this.note, el("div", { class: "columns" }, el("div", {}, el("h4", {}, "Skills"), this.list, this.form, this.answer), el("div", {}, el("h4", {}, "Resources"), this.resources, el("h4", {}, "Data"), this.data)));
  }

  /** Has the server listen to the skillsets as long as they are looked at. */
  look() {
    this.send({ manual: this.box.open });
  }

  ask(act, asked) {
    const sent = this.send({ command: "skill", act, root: this.root, run: this.run, ...asked });
    setText(this.answer, sent ? `${act}: sent …` : "not connected: nothing was asked for");
  }

  say(answer) {
    setText(this.answer, answer);
  }

  /** What the managers said. */
  show(manual) {
    this.run = manual.run;
    const roots = manual.skillsets.map(({ root }) => root);
    if (!roots.includes(this.root)) this.root = roots[0] ?? "";
    rewrite(this.tabs, roots, (root) => el("button", { type: "button", onclick: () => this.choose(root) }, root.replace(/^\//, "")));
    for (const [index, tab] of [...this.tabs.children].entries()) tab.setAttribute("aria-pressed", String(roots[index] === this.root));
    this.manual = manual;
    this.draw();
  }

  choose(root) {
    [this.root, this.skill] = [root, ""];
    this.draw();
  }

  draw() {
    const one = this.manual?.skillsets.find(({ root }) => root === this.root);
    const problems = this.manual?.problems ?? [];
    const said = one ? (one.alive ? "The managers decide; a mission under way commands these skills, too: pause it first." : `The managers of ${one.root} have gone.`) : "No skillset answers in this run yet.";
    setText(this.note, [...problems, this.may ? said : `${said} You watch: to act, take over, in a run that is under way.`].join("; "));
    this.showSkills(one);
    this.showForm(one);
    this.showResources(one);
    rewrite(this.data, (one?.data ?? []).map(({ name, value, age_s: age, stale }) => [name, value, age, stale]), ([name, value, age, stale]) => el("li", { class: stale ? "stale" : "" }, el("b", {}, name), ` ${age === null ? "" : `${seconds(age)} ago${stale ? ", stale" : ""}`}`, el("p", {}, value)));
    this.enableButtons();
  }

  showSkills(one) {
    const skills = one?.skills ?? [];
    if (!skills.some(({ name }) => name === this.skill)) this.skill = skills[0]?.name ?? "";
    rewrite(this.list, skills.map(({ name }) => name), (name) => {
      const parts = { state: el("span", { class: "state" }), bar: el("progress", { max: 1, value: 0, "aria-label": `progress of ${name}` }), last: el("span", { class: "why" }) };
      const row = el("li", {}, el("button", { type: "button", class: "pick", onclick: () => this.pick(name) }, name), parts.state, parts.bar, parts.last);
      row.parts = parts;
      return row;
    });
    skills.forEach(({ name, status, running, last: end }, index) => {
      const row = this.list.children[index];
      const progress = running[0]?.progress ?? null;
      row.dataset.status = running.length ? "RUNNING" : status;
      row.firstChild.setAttribute("aria-pressed", String(name === this.skill));
      setText(row.parts.state, status.toLowerCase());
      row.parts.bar.style.visibility = progress === null ? "hidden" : "visible";
      row.parts.bar.value = progress ?? 0;
      setText(row.parts.last, end ? `last ${words(end.state)} ${end.result}`.trim() : "");
    });
  }

  pick(name) {
    this.skill = name;
    this.draw();
  }

  showForm(one) {
    const skill = one?.skills.find(({ name }) => name === this.skill);
    const key = skill ? `${this.root} ${skill.name} ${JSON.stringify(skill.inputs)}` : "";
    if (key !== this.shown) this.buildForm(skill, key);
    if (!skill) return;
    const runs = skill.running.map(({ id, state, progress }) => `${words(state)} ${id.slice(0, 6)}${progress === null ? "" : `, ${Math.round(100 * progress)} %`}`);
    const needs = runs.length ? runs : skill.unmet.length ? ["could not start now:", ...skill.unmet] : ["could start now"];
    rewrite(this.needs, needs, (sentence) => el("li", {}, sentence));
    this.needs.className = runs.length ? "needs runs" : skill.unmet.length ? "needs unmet" : "needs ready";
    const end = skill.last;
    const outputs = end ? listed(end.outputs) : "";
    setText(this.end, end ? `last end at ${seconds(end.t_s - origin(run))}: ${[words(end.state), end.result, end.message].filter(Boolean).join(" ")}${outputs ? `; outputs: ${outputs}` : ""}` : "not run yet");
    const paused = skill.running.some(({ state }) => state === "PAUSED");
    [this.pauses.hidden, this.resumes.hidden] = [paused, !paused];
    this.running = skill.running.length > 0;
  }

  buildForm(skill, key) {
    this.shown = key;
    this.form.replaceChildren();
    if (!skill) return;
    const kept = this.texts.get(`${this.root} ${skill.name}`) ?? {};
    this.texts.set(`${this.root} ${skill.name}`, kept);
    const field = ({ name, kind, said, text }) => {
      kept[name] ??= text;
      const input = el("input", { type: "text", autocomplete: "off", spellcheck: "false", inputmode: /^(float|u?int)\d+$/.test(kind) ? "decimal" : "text", oninput: (event) => (kept[name] = event.target.value) });
      input.value = kept[name];
      return el("label", {}, el("span", {}, el("b", {}, name), el("span", { class: "hint" }, ` ${[kind, said].filter(Boolean).join(", ")}`)), input);
    };
    const texts = () => ({ skill: skill.name, texts: { ...kept } });
    this.needs = el("ul", { class: "needs" });
    this.end = el("p", { class: "hint" });
    this.starts = this.armed(`start ${skill.name}`, `press again: start ${skill.name}`, () => this.ask("start", texts()), "go");
    this.interrupts = this.armed("interrupt", "press again: interrupt", () => this.ask("interrupt", { skill: skill.name }));
    this.pauses = el("button", { type: "button", onclick: () => this.ask("pause", { skill: skill.name }) }, "pause");
    this.resumes = this.armed("resume", "press again: resume", () => this.ask("resume", { skill: skill.name }), "go");
    this.asks = el("button", { type: "button", onclick: () => this.ask("why", texts()) }, "why?");
    this.form.setAttribute("aria-label", skill.name);
    this.form.append(el("h4", {}, skill.name), el("div", { class: "inputs" }, ...skill.inputs.map(field)), el("div", { class: "acts" }, this.starts, this.interrupts, this.pauses, this.resumes, this.asks), this.needs, this.end);
  }

  showResources(one) {
    const resources = one?.resources ?? [];
    rewrite(this.resources, resources.map(({ name, every_target: every }) => [this.root, name, every]), ([, name, every]) => {
      const state = el("b", {});
      const targets = every.map((to) => {
        const button = this.armed(`→ ${to}`, `again: → ${to}`, () => this.ask("transition", { resource: name, to }));
        button.setAttribute("aria-label", `${name} to ${to}`);
        button.target = to;
        return button;
      });
      const reason = el("p", { class: "hint" });
      const row = el("li", {}, el("span", {}, name), el("div", {}, state, reason), el("span", { class: "acts" }, ...targets));
      [row.state, row.reason, row.targets] = [state, reason, targets];
      return row;
    });
    resources.forEach(({ state, reason, targets }, index) => {
      const row = this.resources.children[index];
      setText(row.state, state);
      setText(row.reason, reason);
      for (const button of row.targets) button.hidden = !targets.includes(button.target);
    });
  }

  /** Switches the acts on for the viewer that commands a run under way. */
  enable(may) {
    if (may === this.may) return;
    this.may = may;
    this.draw();
  }

  /** What was known belongs to another run, or to one that is over. */
  forget() {
    if (!this.manual) return;
    [this.manual, this.run] = [null, ""];
    rewrite(this.tabs, [], () => null);
    this.draw();
  }

  /** What a skill's state forbids stays off. */
  enableButtons() {
    for (const button of this.resources.querySelectorAll("button")) button.disabled = !this.may;
    if (!this.form.firstChild) return;
    for (const button of [this.starts, this.asks]) button.disabled = !this.may;
    for (const button of [this.interrupts, this.pauses, this.resumes]) button.disabled = !this.may || !this.running;
  }
}
