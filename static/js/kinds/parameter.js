// A parameter: its input shows the robot's value, with the limits that its node describes.
import { showBounds, showEntry } from "../entries.js";

export const show = {
  askable: (root, value) => (root.querySelector(".read").disabled = !value),
  entry: showEntry,
  bounds: showBounds,
  settable: (root, value) => (root.querySelector(".setting").inert = !value),
};
