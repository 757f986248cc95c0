// The confirmation of the next hold by a person, where the hold needs one. The hold is the touch after it.
import { enteredValues } from "./entries.js";
import { needsPerson } from "./show.js";

export class HoldProof {
  #root;
  #show;
  #confirmation = "";

  /** @param {HTMLElement} root @param {(outcome: string, reason: string) => void} show */
  constructor(root, show) {
    this.#root = root;
    this.#show = show;
  }

  // Whether the touch has to be confirmed before it can hold.
  get isMissing() {
    return needsPerson(this.#root) && !this.#confirmation;
  }

  // What the begin of a hold has of it; it is used up.
  take() {
    const proof = this.#confirmation ? { confirmation: this.#confirmation } : {};
    this.#confirmation = "";
    return proof;
  }

  async ask() {
    const { confirmByPerson } = await import("./confirm-person.js");
    await confirmByPerson(this.#root, enteredValues(), (_, proof) => this.#keep(proof), null);
  }

  /** @param {import("./confirm-person.js").Proof} proof */
  #keep({ confirmation, valid_s, reason }) {
    this.#confirmation = confirmation;
    this.#show("confirmed", reason);
    setTimeout(() => {
      if (this.#confirmation !== confirmation) return;
      this.#confirmation = "";
      this.#show("", "");
    }, 1000 * valid_s);
  }
}
