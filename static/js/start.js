// The script of a page's markup: the modules do nothing before it.
import { start } from "./main.js";

start();
