// A socket for presses: a post costs a browser more than all the rest of a press. Loaded with the first
// touch of a page.
export class Line {
  #socket;
  #waiting = new Map(); // who waits for the answer to a press
  #left = false;

  constructor(broke) {
    this.#socket = new WebSocket(new URL(`${document.body.dataset.base}/presses`, location).href.replace(/^http/, "ws"));
    this.#socket.onmessage = ({ data }) => {
      const answer = JSON.parse(data);
      this.#waiting.get(answer.press)?.resolve(answer);
    };
    this.#socket.onclose = () => {
      for (const { reject } of this.#waiting.values()) reject();
      broke(this);
    };
  }

  // Open, and with nothing in it that did not leave.
  get free() {
    return this.#socket.readyState === WebSocket.OPEN && !this.#socket.bufferedAmount;
  }

  // The press leaves at once; no answer comes before this returns.
  ask(press, answerMs) {
    this.#socket.send(JSON.stringify(press));
    return new Promise((resolve, reject) => {
      this.#waiting.set(press.id, { resolve, reject });
      setTimeout(reject, answerMs);
    }).finally(() => {
      this.#waiting.delete(press.id);
      if (this.#left) this.leave();
    });
  }

  // Nothing more is asked: it closes when the last one has its answer.
  leave() {
    this.#left = true;
    if (!this.#waiting.size) this.#socket.close();
  }
}
