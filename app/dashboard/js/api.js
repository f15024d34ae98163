/** The service's public API: JSON, problem details, keys, entity tags and event streams. */

const KEY = "allocator-key";
const RETRY_MS = 1000;
let askForKey = async () => null;

/** An answer that is no success; `problem` is its problem details, `violations` its errors field by field. */
export class ApiError extends Error {
  constructor(status, problem, retryAfter = null) {
    super(problem.detail ?? `the service answered ${status}`);
    this.status = status;
    this.problem = problem;
    this.violations = problem.errors ?? [];
    this.retryAfter = retryAfter;
  }
}

/** Say how a key is asked for: a function that resolves to the key, or null. */
export function onKeyNeeded(ask) {
  askForKey = ask;
}

/** Use a key from now on; null: none. */
export function useKey(key) {
  if (key) sessionStorage.setItem(KEY, key);
  else sessionStorage.removeItem(KEY);
}

/** The address of a path of the API, whatever prefix the service stands behind. */
export function address(path) {
  return new URL(path.replace(/^\//, ""), document.baseURI).href;
}

/**
 * Send a request; a 401 asks for a key once and tries again.
 * @param {string} path
 * @param {{method?: string, body?: any, headers?: object, signal?: AbortSignal}} [options] body is sent as JSON
 * @returns {Promise<Response>} of a status below 400
 * @throws {ApiError}
 */
export async function send(path, { method = "GET", body, headers = {}, signal } = {}) {
  for (let asked = false; ; asked = true) {
    const key = sessionStorage.getItem(KEY);
    const response = await fetch(address(path), {
      method,
      signal,
      headers: {
        ...(body === undefined ? {} : { "Content-Type": "application/json" }),
        ...(key ? { Authorization: `Bearer ${key}` } : {}),
        ...headers,
      },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    if (response.ok || response.status === 304) return response;
    const problem = await response.json().catch(() => ({}));
    if (response.status === 401 && !asked) {
      const given = await askForKey(problem.detail);
      if (given) {
        useKey(given);
        continue;
      }
    }
    throw new ApiError(response.status, problem, response.headers.get("Retry-After"));
  }
}

/** Like send, with the answer's JSON. */
export async function json(path, options) {
  return (await send(path, options)).json();
}

/**
 * Read a resource that has an entity tag, unless it is still the one known.
 * @param {string} path
 * @param {string | null} etag of the copy at hand
 * @returns {Promise<{etag: string | null, body: Blob | null}>} body is null where nothing changed
 */
export async function changed(path, etag) {
  const response = await send(path, etag ? { headers: { "If-None-Match": etag } } : {});
  return { etag: response.headers.get("ETag"), body: response.status === 304 ? null : await response.blob() };
}

/**
 * Follow a job's events to its end, going on after the last one seen where the connection breaks.
 * @param {string} id of the job
 * @param {(name: string, data: object) => void} listen
 * @param {AbortSignal} [signal]
 */
export async function follow(id, listen, signal) {
  let last = null;
  for (;;) {
    try {
      const response = await send(`jobs/${id}/events`, { signal, headers: last ? { "Last-Event-ID": last } : {} });
      for await (const event of events(response.body)) {
        last = event.id ?? last;
        if (event.data) listen(event.name, JSON.parse(event.data));
        if (event.name === "end") return;
      }
    } catch (error) {
      if (signal?.aborted || error instanceof ApiError) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
  }
}

/** Server-sent events of a stream of bytes (EventSource can send no key). */
async function* events(stream) {
  const reader = stream.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    text = (text + value).replace(/\r\n/g, "\n");
    for (let end = text.indexOf("\n\n"); end >= 0; end = text.indexOf("\n\n")) {
      yield parsed(text.slice(0, end));
      text = text.slice(end + 2);
    }
  }
}

function parsed(block) {
  const event = { name: "message", id: null, data: "" };
  for (const line of block.split("\n")) {
    const [, field, value] = /^(\w*): ?(.*)$/.exec(line) ?? [];
    if (field === "event") event.name = value;
    else if (field === "id") event.id = value;
    else if (field === "data") event.data += value;
  }
  return event;
}
