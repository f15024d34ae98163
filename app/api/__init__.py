"""The REST service: routes, wire models, errors; the only room that knows HTTP."""
