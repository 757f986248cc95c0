// A camera: requests the next picture when the last one is drawn, and only while the widget is visible.
import { find } from "../show.js";

const RETRY_MS = 1000;
const WATCH_MS = 100;

// Called for each widget of this kind.
/** @param {HTMLElement} root */
export const equip = (root) => new Camera(root);

class Camera {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLCanvasElement} */
  #canvas;
  /** @type {WebSocket | null} */
  #socket = null;
  #onScreen = false;
  #retry = 0;
  /** @type {{ type: string, number: string, time: string } | null} */
  #header = null; // of the bytes that come next
  #drawnAt = 0;

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#canvas = find(root, "canvas");
    new IntersectionObserver((entries) => {
      this.#onScreen = entries[entries.length - 1].isIntersecting;
      this.#update();
    }).observe(root);
    document.addEventListener("visibilitychange", () => this.#update());
    addEventListener("pagehide", () => this.#close());
    addEventListener("pageshow", () => this.#update());
    setInterval(() => this.#watch(), WATCH_MS);
  }

  #update() {
    if (this.#onScreen && !document.hidden) this.#open();
    else this.#close();
  }

  #open() {
    if (this.#socket) return;
    clearTimeout(this.#retry);
    const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/frames`;
    const socket = new WebSocket(new URL(path, location.href).href.replace(/^http/, "ws"));
    socket.binaryType = "blob";
    this.#socket = socket;
    this.#drawnAt = performance.now();
    socket.onopen = () => this.#requestPicture(socket);
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.#header = JSON.parse(data);
      else if (this.#header) this.#draw(socket, data, this.#header);
    };
    socket.onclose = () => {
      if (socket !== this.#socket) return;
      this.#socket = null;
      this.#retry = setTimeout(() => this.#update(), RETRY_MS);
    };
  }

  #close() {
    clearTimeout(this.#retry);
    this.#socket?.close();
    this.#socket = null;
  }

  /** @param {WebSocket} socket */
  #requestPicture(socket) {
    if (socket.readyState === WebSocket.OPEN) socket.send('{"next": true}');
  }

  /** @param {WebSocket} socket @param {Blob} bytes @param {{ type: string, number: string, time: string }} header */
  async #draw(socket, bytes, { type, number, time }) {
    try {
      const picture = await createImageBitmap(new Blob([bytes], { type }));
      if (socket !== this.#socket) return picture.close();
      const { width, height } = picture;
      if (this.#canvas.width !== width) this.#canvas.width = width;
      if (this.#canvas.height !== height) this.#canvas.height = height;
      this.#canvas.getContext("2d")?.drawImage(picture, 0, 0);
      picture.close();
      find(this.#root, ".taken").textContent = time;
      this.#root.dataset.frame = number;
      this.#drawnAt = performance.now();
      delete this.#root.dataset.broken;
      delete this.#root.dataset.late;
    } catch {
      this.#root.dataset.broken = "";
    }
    // The next one with the next frame of the screen, which a hidden page does not have.
    requestAnimationFrame(() => this.#requestPicture(socket));
  }

  // The robot may send, and this browser get nothing: then its picture is old all the same.
  #watch() {
    if (!this.#socket || this.#root.dataset.state !== "live") return;
    const late = performance.now() - this.#drawnAt > Number(this.#root.dataset.maxAge) + RETRY_MS;
    this.#root.toggleAttribute("data-late", late);
  }
}
