/** Every view, one line each; a view registers itself. */

import "./problem.js";
import "./allocate.js";
import "./answer.js";
import "./compare.js";
import "./missions.js";
import "./library.js";
import "./take_away.js";
import "./recent.js";
