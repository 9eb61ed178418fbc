// What the cameras showed at the moment; what each shows, and the figures below its picture, the robot says.

const OLD_S = 3;

class PicturesView {
  constructor() {
    this.box = byId("pictures");
    this.figures = new Map();
  }

  draw(run, t) {
    [this.run, this.t] = [run, t];
    this.box.closest("section").hidden = !run.pictures.size;
    for (const camera of run.pictures.keys()) if (!this.figures.has(camera)) this.frame(camera);
    for (const [camera, figure] of this.figures) this.update(camera, figure);
  }

  frame(camera) {
    const image = el("img", { alt: "", width: 512, height: 288 });
    const [when, numbers] = [el("b", {}), el("p", { class: "hint" })];
    this.box.append(el("figure", {}, el("figcaption", {}, el("span", {}, this.about(camera)), when), image, numbers));
    this.figures.set(camera, { image, when, numbers, shown: null });
  }

  update(camera, figure) {
    const track = this.run.pictures.get(camera) ?? newTrack();
    const index = indexAt(track.t, this.t);
    const jpeg = index < 0 ? null : track.v[index];
    if (figure.shown !== jpeg) {
      figure.shown = jpeg;
      if (jpeg) figure.image.src = `data:image/jpeg;base64,${jpeg}`;
      else figure.image.removeAttribute("src");
    }
    const age = index < 0 ? null : this.t - track.t[index];
    figure.image.classList.toggle("old", age !== null && age > OLD_S);
    const said = age === null ? "no picture yet" : `${seconds(track.t[index] - origin(this.run))}${age > OLD_S ? `, ${seconds(age, 0)} old` : ""}`;
    setText(figure.when, said);
    const numbers = this.numbers(camera);
    setText(figure.numbers, numbers);
    figure.image.alt = `${this.about(camera)}; picture of ${said}. ${numbers}`;
  }

  about(camera) {
    return robotWords(this.run).cameras[camera]?.about ?? camera;
  }

  /** The figures that belong to a camera's picture at the moment, and since when some of them have not been measured. */
  numbers(camera) {
    const { data, figures = {} } = robotWords(this.run).cameras[camera] ?? {};
    const samples = this.run.data.get(data);
    const measured = [];
    const missing = new Map();
    for (const [name, { label, unit, digits, factor }] of samples ? Object.entries(figures) : []) {
      const column = samples.columns.get(name);
      if (!column) continue;
      const { value, since } = readingAt(samples.t, column, this.t);
      if (typeof value === "number") measured.push(`${fixed(factor * value, digits)} ${unit}`);
      else if (since !== null) missing.set(since, [...(missing.get(since) ?? []), label]);
    }
    const gaps = [...missing].map(([since, titles]) => `no data since ${seconds(since - origin(this.run))}: ${titles.join(", ")}`);
    return [measured.join(", "), ...gaps].filter(Boolean).join("; ");
  }
}
