/** The first module: the language comes before all others, which write their texts while they are loaded. */

import { loadLanguage } from "./language.js";

await loadLanguage();
await import("./main.js");
