// The tree at a moment, a node a line, in the signs of the paper's Figure 10: skills green, internal actions grey, a parallel a purple
// trapezium, a sequence an arrow, a selector a question mark.

const SYMBOLS = { sequence: "→ ", selector: "? ", parallel: "⇉ ", decorator: "◇ ", control: "⊚ ", subtree: "↳ " };
const LEGEND = [
  ["sequence", SYMBOLS.sequence, "one after the other, until one fails"],
  ["selector", SYMBOLS.selector, "the next one when one fails"],
  ["parallel", SYMBOLS.parallel, "all at once"],
  ["decorator", SYMBOLS.decorator, "changes when its child runs, or what its end means"],
  ["control", SYMBOLS.control, "chooses among its children"],
  ["subtree", SYMBOLS.subtree, "another tree of the mission's file"],
  ["skill", "name", "skill"],
  ["action", "name", "the mission's own action"],
  ["condition", "name", "condition"],
];
const MARKS = { SUCCESS: "✓ succeeded", FAILURE: "✗ failed", RUNNING: "… runs", INTERRUPTED: "◦ interrupted", INVALID: "" };

const STOPPED = { SUCCESS: "◦ stopped, as it was told to", FAILURE: "✗ could not be stopped", RUNNING: "… is being stopped" };

/** What a node's status means, in words and in colour: the root of a mission that was aborted did not succeed when all has come to rest. */
function statusTold(run, node, status, t) {
  const aborted = node.depth === 0 && abortAfter(run, -Infinity) <= t;
  return { told: (aborted && STOPPED[status]) || (MARKS[status] ?? words(status)), colour: aborted && status === "SUCCESS" ? "INTERRUPTED" : status };
}

class TreeView {
  constructor(choose) {
    this.box = byId("tree");
    this.choose = choose; // called with a moment
    this.tree = null;
    this.chosen = null;
    this.closed = new Set();
    this.activeOnly = false;
    byId("tree-active").addEventListener("click", () => this.show(true));
    byId("tree-all").addEventListener("click", () => this.show(false));
    this.box.addEventListener("keydown", (event) => this.key(event));
    byId("tree-legend").append(...LEGEND.map(([kind, sign, text]) => el("li", {}, el("span", { class: `box ${kind}` }, sign), text)));
  }

  show(activeOnly) {
    this.activeOnly = activeOnly;
    this.closed.clear();
    this.draw(this.run, this.t);
  }

  draw(run, t) {
    [this.run, this.t] = [run, t];
    const tree = treeAt(run, t);
    if (!tree) {
      if (!this.box.firstChild) this.box.append(el("p", { class: "hint" }, "The record holds no tree yet."));
      return;
    }
    if (tree !== this.tree) this.build(tree);
    const running = [];
    tree.nodes.forEach((node, index) => {
      const { status, message, since } = nodeAt(node, t);
      const row = this.rows[index];
      node.shownStatus = status;
      if (status === "RUNNING" && !node.children.length) running.push(node);
      row.classList.toggle("active", status === "RUNNING");
      const { told, colour } = statusTold(run, node, status, t);
      if (row.dataset.status !== colour) row.dataset.status = colour;
      const parts = this.parts[index];
      setText(parts.state, told);
      setText(parts.why, status === "INVALID" ? "" : [status === "RUNNING" && since !== null ? seconds(t - since) : "", message].filter(Boolean).join("  "));
    });
    for (const node of tree.nodes) {
      const hidden = !this.visible(node);
      if (this.rows[node.index].hidden !== hidden) this.rows[node.index].hidden = hidden;
    }
    this.box.setAttribute("aria-label", running.length ? `Behaviour tree; running: ${running.map(({ name }) => name).join(", ")}` : "Behaviour tree");
    if (this.chosen !== null) this.detail(tree.nodes[this.chosen]);
  }

  visible(node) {
    if (this.activeOnly && node.shownStatus !== "RUNNING" && !(node.shownStatus === "FAILURE" && !node.children.length)) return false;
    for (let above = node.parent; above; above = above.parent) if (this.closed.has(above.index)) return false;
    return true;
  }

  build(tree) {
    [this.tree, this.parts, this.chosen] = [tree, [], null];
    this.closed.clear();
    this.rows = tree.nodes.map((node) => {
      const skill = node.skill.split(".").pop();
      const label = `${SYMBOLS[node.kind] ?? ""}${node.name}${skill && skill !== node.name ? ` (${skill})` : ""}`;
      const parts = { state: el("span", { class: "state" }), why: el("span", { class: "why" }) };
      this.parts.push(parts);
      const folder = el("button", { type: "button", class: "fold", tabindex: -1, "aria-label": `fold ${node.name}`, onclick: (event) => this.toggle(event, node) }, node.children.length ? "▾" : "");
      const kind = ["skill", "action", "condition", "sequence", "selector", "parallel", "decorator", "control", "subtree"].includes(node.kind) ? node.kind : "action";
      const row = el("div", { class: "row", role: "treeitem", "aria-level": node.depth + 1, title: [node.kind, node.skill || node.name, node.source, node.place].filter(Boolean).join("  "), onclick: () => this.select(node) }, folder, el("span", { class: `box ${kind}` }, label), parts.state, parts.why);
      row.style.setProperty("--depth", node.depth);
      if (node.children.length) row.setAttribute("aria-expanded", "true");
      return row;
    });
    this.box.replaceChildren(...this.rows);
    byId("node").replaceChildren(el("p", { class: "hint" }, "Choose a node to read its skill's inputs, results and history."));
  }

  toggle(event, node) {
    event.stopPropagation();
    const closing = !this.closed.has(node.index);
    if (closing) this.closed.add(node.index);
    else this.closed.delete(node.index);
    this.rows[node.index].setAttribute("aria-expanded", String(!closing));
    setText(this.rows[node.index].querySelector(".fold"), closing ? "▸" : "▾");
    this.draw(this.run, this.t);
  }

  select(node) {
    this.rows.forEach((row, index) => row.classList.toggle("chosen", index === node.index));
    this.rows.forEach((row, index) => row.setAttribute("aria-selected", String(index === node.index)));
    this.chosen = node.index;
    this.detail(node);
  }

  key(event) {
    if (!this.tree || !["ArrowDown", "ArrowUp", "ArrowLeft", "ArrowRight"].includes(event.key)) return;
    event.preventDefault();
    const shownNodes = this.tree.nodes.filter((node) => !this.rows[node.index].hidden);
    const place = shownNodes.findIndex((node) => node.index === this.chosen);
    const node = shownNodes[place];
    if (event.key === "ArrowDown") this.select(shownNodes[Math.min(place + 1, shownNodes.length - 1)]);
    else if (event.key === "ArrowUp") this.select(shownNodes[Math.max(place - 1, 0)]);
    else if (node?.children.length && this.closed.has(node.index) === (event.key === "ArrowRight")) this.toggle(event, node);
    this.rows[this.chosen]?.scrollIntoView({ block: "nearest" });
  }

  /** What a node is and was: its changes, and the executions of its skill. */
  detail(node) {
    const { status, message, since } = nodeAt(node, this.t);
    const zero = origin(this.run);
    const lines = [el("p", {}, el("b", {}, node.name), ` — ${node.kind}, ${status === "INVALID" ? "not ticked" : statusTold(this.run, node, status, this.t).told}${since === null ? "" : ` since ${seconds(since - zero)}`}${message ? `: ${message}` : ""}`)];
    if (node.place) lines.push(el("p", { class: "hint" }, `${node.source}  (${node.place})`));
    const executions = [...this.run.executions.values()].filter((one) => `${one.skillset}.${one.skill}` === node.skill && one.start <= this.t);
    for (const one of executions.slice(-8)) {
      const ended = one.end !== null && one.end <= this.t;
      const text = `${seconds(one.start - zero)} – ${ended ? seconds(one.end - zero) : "now"}  ${ended ? `${words(one.state)} ${one.result} ${one.message}` : "runs"}`;
      lines.push(el("p", {}, el("button", { type: "button", onclick: () => this.choose(one.start) }, "show"), ` ${text}`), el("p", { class: "hint" }, `inputs: ${listed(one.inputs) || "none"}${ended && Object.keys(one.outputs).length ? `; outputs: ${listed(one.outputs)}` : ""}`));
    }
    const key = JSON.stringify([node.index, status, message, executions.map(({ end, id }) => [id, end !== null && end <= this.t])]);
    if (this.detailKey === key) return;
    this.detailKey = key;
    byId("node").replaceChildren(...lines);
  }
}
