// A press: on release, once, with an id of its own; its receipt is shown where it was pressed.
const ANSWER_WITHIN_MS = 5000;
// Two taps of a finger come within this time: the second one is the same press.
const TAP_AGAIN_MS = 700;
export const ENTRIES = "input:not([type=hidden]), select";

function newId() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// With its type. What is no number (an empty field) goes as it is: the server says what is wrong.
export function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  const number = input.type === "number" || input.type === "range";
  return number && input.value !== "" ? Number(input.value) : input.value;
}

export class Presser {
  #widgets;
  #source;
  #sentences;
  #underWay = new Set();
  #down = null; // the button that was open when the pointer went down on it

  constructor(widgets, source, sentences) {
    this.#widgets = widgets;
    this.#source = source;
    this.#sentences = sentences;
    addEventListener("pointerdown", ({ target }) => (this.#down = target.closest?.("button:enabled")), true);
    for (const form of document.forms) {
      // A button that opened under a resting finger was not pressed.
      form.addEventListener("click", (event) => {
        const button = event.target.closest("button");
        if (button && event.detail > 0 && button !== this.#down) event.preventDefault();
      });
      form.addEventListener("submit", (event) => {
        event.preventDefault();
        const root = event.submitter?.closest("[data-widget]");
        if (root && !event.submitter.disabled) this.#press(root, event.submitter, form);
      });
    }
  }

  // A second tap while the first is under way is the same press: it sends nothing.
  async #press(root, button, form) {
    const url = button.getAttribute("formaction");
    if (this.#underWay.has(url)) return;
    this.#underWay.add(url);
    button.setAttribute("aria-busy", "true");
    const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
    try {
      const answerMs = ANSWER_WITHIN_MS + 1000 * (root.dataset.answerS ?? 0);
      this.#show(root, await this.#send(url, form, answerMs));
      await pause;
    } finally {
      this.#underWay.delete(url);
      button.removeAttribute("aria-busy");
    }
  }

  // Sent once and never again: when no answer comes, it is not known what became of it.
  async #send(url, form, answerMs) {
    const inputs = {};
    for (const input of form.elements) {
      if (input.matches(ENTRIES) && input.closest("[data-widget]")) inputs[input.name] = valueOf(input);
    }
    const press = { inputs, id: newId(), seen: this.#source.seen, at: new Date().toISOString() };
    try {
      const answer = await fetch(url, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(press),
        signal: AbortSignal.timeout(answerMs),
      });
      const receipt = await answer.json();
      return receipt.outcome ? receipt : { outcome: "refused", reason: receipt.error };
    } catch {
      return { outcome: "unknown", reason: this.#sentences.unsure };
    }
  }

  #show(root, { outcome, reason }) {
    for (const other of this.#widgets.values()) {
      const old = other.querySelector(".receipt");
      if (old && other !== root) {
        old.textContent = "";
        delete old.dataset.outcome;
      }
    }
    // What came of a call is shown to every browser, with the widget's other texts.
    if (root.querySelector(".result") && outcome !== "refused" && outcome !== "unknown") return;
    const receipt = root.querySelector(".receipt");
    receipt.dataset.outcome = outcome;
    receipt.textContent = reason;
  }
}
