// The gallery: its number inputs and keys are as on a page, without a server behind them. In development only.
import { equipInputs } from "./number-inputs.js";
import { equipKeys } from "./show.js";

equipInputs();
equipKeys(() => import("./whole-text.js"));
