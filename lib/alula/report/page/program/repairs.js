// What could have been done about a failure: the command that tells it, and on the live page its answer, searched for by the server.

class RepairsView {
  constructor() {
    [this.bar, this.found, this.beside, this.news, this.says] = [null, {}, false, "", new Map()];
  }

  /** What a row shows besides the command: "" in a report, else "idle", "beside" a mission under way, "going", "answered". */
  phase(fault) {
    if (!this.bar) return "";
    const one = this.found[fault];
    return one ? (one.answer === null ? "going" : "answered") : this.beside ? "beside" : "idle";
  }

  /** The whole answer for a fault, below the rows. */
  whole(fault, command) {
    return el("details", { open: true }, el("summary", {}, command), el("pre", { tabindex: 0 }, this.found[fault].answer));
  }

  /** How things are; tells whether rows have to be drawn anew. */
  show(found, beside) {
    [this.found, this.beside] = [found, beside];
    for (const [fault, node] of this.says) setText(node, found[fault]?.says ?? "");
    const news = JSON.stringify([beside, Object.keys(found).map((fault) => [fault, this.phase(fault)])]);
    const changed = news !== this.news;
    this.news = news;
    return changed;
  }

  /** What a row shows for a fault. */
  of(fault) {
    const asked = (beside) => ({ fault, beside });
    this.says.delete(fault);
    switch (this.phase(fault)) {
      case "idle":
        return this.bar.armed("look for it", "press again: takes a minute of a core", () => this.bar.tell("search", asked(false)), "search");
      case "beside":
        return this.bar.armed("look for it beside the mission", "press again: takes the mission's processor", () => this.bar.tell("search", asked(true)), "search");
      case "going": {
        const says = el("p", { class: "hint", role: "status" }, this.found[fault].says);
        this.says.set(fault, says);
        return el("div", {}, says, el("button", { type: "button", onclick: () => this.bar.tell("stop search", asked(false)) }, "stop with what it has"));
      }
      case "answered":
        return el("p", { class: "hint" }, this.found[fault].answer.split("\n", 1)[0]);
      default:
        return null;
    }
  }
}

const repairs = new RepairsView();
