// The line of alarms below the header, and those on pages: the newest unacknowledged alarm of the highest priority, and
// its Acknowledge.
import { followLock, isLocked, markLock, sendAct, setControl, setLock } from "./alarm-acts.js";
import { closest, find, setText } from "./show.js";

const TEXTS = ["priority_text", "since_text", "text", "action"];

export class LineView {
  #line;
  #button;
  #occurrence;
  #source;
  /** @type {{ id: string, occurrence: number, seen: string | null } | null} */
  #touched = null; // the alarm that the line showed when the finger went down on an enabled button
  #refusedFor = "";
  #busy = false;

  /** @param {HTMLElement} line @param {import("./source.js").Source} source */
  constructor(line, source) {
    this.#line = line;
    this.#button = find(line, "button[type=submit]");
    this.#occurrence = line.querySelector("input[name=occurrence]") ?? this.#button;
    this.#source = source;
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    this.#button.addEventListener("click", (event) => {
      event.preventDefault();
      this.#acknowledge(event);
    });
    followLock(() => this.#lock());
  }

  /** @param {Data} alarms */
  show(alarms) {
    const row = alarms.line;
    const { dataset } = this.#line;
    dataset.alarm = row?.id ?? "";
    dataset.priority = row?.priority ?? "";
    dataset.known = row?.known ?? true;
    dataset.standing = alarms.standing;
    this.#occurrence.value = row?.occurrence ?? "";
    for (const name of TEXTS) setText(this.#text(name), row?.[name] ?? "");
    setText(this.#text("unacknowledged"), String(alarms.unacknowledged));
    setText(this.#text("standing"), String(alarms.standing));
    if (this.#refusedFor !== this.#shown) setText(find(this.#line, ".refused"), "");
    this.#lock();
  }

  #lock() {
    markLock(this.#line);
    if (isLocked()) this.#touched = null;
    this.#button.disabled = !this.#line.dataset.alarm || isLocked();
  }

  /** @param {string} name */
  #text(name) {
    return find(this.#line, `[data-text="${name}"]`);
  }

  get #shown() {
    return `${this.#line.dataset.alarm} ${this.#occurrence.value}`;
  }

  // The alarm that is shown now.
  #alarm() {
    const occurrence = Number(this.#occurrence.value);
    return { id: this.#line.dataset.alarm ?? "", occurrence, seen: this.#source.seen };
  }

  /** @param {EventTarget | null} target */
  #down(target) {
    this.#touched = closest(target, "button:enabled") === this.#button ? this.#alarm() : null;
  }

  // Acknowledges what was shown at the touch.
  /** @param {MouseEvent} event */
  async #acknowledge(event) {
    const alarm = event.detail > 0 ? this.#touched : this.#alarm();
    if (!alarm || this.#busy) return;
    this.#busy = true;
    this.#line.setAttribute("aria-busy", "true");
    const { id, occurrence, seen } = alarm;
    const body = { occurrence, seen: seen ?? "", at: this.#source.timeOf(event) };
    const reason = await sendAct(this.#line.dataset.root ?? "", `${encodeURIComponent(id)}/acknowledge`, body);
    this.#refusedFor = this.#shown;
    setText(find(this.#line, ".refused"), reason);
    this.#busy = false;
    this.#line.removeAttribute("aria-busy");
  }
}

// The line of the frame: it also says to the rest of the page what is locked.
export class AlarmLine {
  #line = find(document, "form.alarm-line");
  #view;
  #isSnapshot = true; // the next section is whole: the first of a stream
  /** @type {(alarms: Data, isSnapshot: boolean) => void} */
  #showRows = () => {}; // of a page without the list
  #source;
  /** @type {{ update(alarms: Data, server: string): void, lost(): void } | null} */
  #sound = null; // of a panel without sound

  /** @param {import("./source.js").Source} source */
  constructor(source) {
    if (document.querySelector(".alarm-list ol.alarms"))
      source.load(import("./alarm-list.js"), ({ showRows }) => (this.#showRows = showRows));
    if (document.querySelector("#alarm-sheet[popover]"))
      source.load(import("./alarm-sheet.js"), ({ equip }) => equip(source));
    if (this.#line.dataset.sound)
      source.load(import("./alarm-sound.js"), ({ update, lost }) => (this.#sound = { update, lost }));
    this.#source = source;
    this.#view = new LineView(this.#line, source);
    this.#line.addEventListener("submit", (event) => event.preventDefault());
  }

  /** @param {Data} alarms */
  show(alarms) {
    setLock({ isCut: false });
    this.#view.show(alarms);
    const badge = document.querySelector(".pages .badge");
    if (badge) badge.dataset.priority = this.#line.dataset.priority;
    this.#showRows(alarms, this.#isSnapshot);
    this.#isSnapshot = false;
    this.#sound?.update(alarms, (this.#source.seen ?? "").split("-")[0]);
  }

  /** @param {string} role */
  control(role) {
    setControl(role);
  }

  lost() {
    this.#isSnapshot = true;
    setLock({ isCut: true });
    this.#sound?.lost();
  }
}
