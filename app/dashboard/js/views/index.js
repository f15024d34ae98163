/** Every view, one line each; a view registers itself. */

import "./problem.js";
import "./allocate.js";
import "./answer.js";
