// A WebSocket for presses: faster than a POST in most browsers. Loaded with the first touch of a page.
export class PressSocket {
  /** @type {WebSocket} */
  #socket;
  /** @type {Map<string, { resolve: (response: Data) => void, reject: () => void }>} */
  #pending = new Map(); // press id → its promise
  #leaving = false;

  /** @param {(socket: PressSocket) => void} onClose */
  constructor(onClose) {
    const { base, embed } = pageGuard.page;
    const url = new URL(`${base}/presses${embed}`, location.href);
    this.#socket = new WebSocket(url.href.replace(/^http/, "ws"));
    this.#socket.onmessage = ({ data }) => {
      const response = JSON.parse(data);
      this.#pending.get(response.press)?.resolve(response);
    };
    this.#socket.onclose = () => {
      for (const { reject } of this.#pending.values()) reject();
      onClose(this);
    };
  }

  // Whether it is open and its buffer is empty.
  get free() {
    return this.#socket.readyState === WebSocket.OPEN && !this.#socket.bufferedAmount;
  }

  // Sends the press at once. No response arrives before this returns.
  /** @param {Press} press @param {number} timeoutMs */
  send(press, timeoutMs) {
    this.#socket.send(JSON.stringify(press));
    return new Promise((resolve, reject) => {
      this.#pending.set(press.id, { resolve, reject });
      setTimeout(reject, timeoutMs);
    }).finally(() => {
      this.#pending.delete(press.id);
      if (this.#leaving) this.leave();
    });
  }

  // Closes the socket after the last pending response.
  leave() {
    this.#leaving = true;
    if (!this.#pending.size) this.#socket.close();
  }
}
