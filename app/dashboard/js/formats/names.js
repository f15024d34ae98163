/** Names that people give to the columns of their lists, in English, French, Portuguese and Spanish. */

/** By the field that is meant; of words in lower case without accents. `x` and `y` are those of any kind of item. */
const WORDS = {
  id: ["id", "code", "codigo", "pcode", "ref", "reference", "referencia"],
  name: ["name", "place", "site", "village", "town", "settlement", "locality", "area", "uav", "drone", "base", "nom", "lieu", "localite", "ville", "nome", "lugar", "local", "localidade", "aldeia", "nombre", "localidad", "sitio", "aldea", "pueblo"],
  y: ["lat", "latitude", "latitud", "y"],
  x: ["lon", "lng", "long", "longitude", "longitud", "x"],
  amount: ["need", "needs", "demand", "load", "payload", "stock", "existencias", "quantity", "qty", "amount", "units", "kg", "weight", "besoin", "besoins", "demande", "charge", "quantite", "poids", "necessidade", "necessidades", "procura", "carga", "quantidade", "peso", "necesidad", "necesidades", "demanda", "cantidad"],
  level: ["urgency", "priority", "level", "severity", "urgence", "priorite", "niveau", "urgencia", "prioridade", "nivel", "prioridad"],
  deadline: ["deadline", "due", "until", "latest", "echeance", "limite", "prazo", "plazo"],
  earliest: ["earliest", "from", "debut", "inicio"],
  service_time: ["service", "unloading", "dechargement", "descarga"],
  speed: ["speed", "velocity", "vitesse", "velocidade", "velocidad"],
  voyage: ["range", "voyage", "reach", "autonomie", "portee", "rayon", "alcance", "autonomia"],
};

/** Words of columns that number, date or describe a place, and are no amounts of a material. */
const NO_AMOUNTS = new Set(["no", "nr", "num", "number", "numero", "row", "line", "index", "fid", "objectid", "gid", "uuid", "key", "cle", "clave", "chave", "zip", "postcode", "phone", "tel", "telephone", "telefone", "telefono", "year", "annee", "ano", "date", "fecha", "data", "time", "population", "pop", "populacao", "poblacion", "households", "elevation", "altitude", "altitud", "distance", "distancia"]);
/** Words between that of an amount and its material, as in `besoin en eau`. */
const JOINING = new Set(["of", "for", "en", "de", "du", "des", "da", "do", "del", "la", "le", "les"]);

/** A text in lower case, without accents. */
export function plainName(text) {
  return text.normalize("NFD").replace(/\p{M}/gu, "").toLowerCase();
}

/** What a name of a column says: its words, and the number at its end if it has one. */
function wordsOf(name) {
  const plain = plainName(name);
  const number = /(?:^|[^\d])([1-9]\d?)$/.exec(plain)?.[1];
  return { words: plain.split(/[^a-z]+/).filter(Boolean), number: number ? Number(number) : null };
}

/**
 * The field that a name means, as a key of `WORDS`.
 * @param {string} name of a column
 * @returns {{field: string, number: number | null} | null}
 */
export function meant(name) {
  const { words, number } = wordsOf(name);
  const whole = words.join("_");
  const is = (known) => ([, each]) => each.some((word) => known.includes(word));
  const [field] = (whole in WORDS && [whole]) || Object.entries(WORDS).find(is([whole])) || Object.entries(WORDS).find(is(words)) || [];
  return field ? { field, number } : null;
}

/** Whether a column of numbers may be amounts of a material: its name says nothing else. @param {string} name of a column */
export function mayBeAmounts(name) {
  const { field } = meant(name) ?? {};
  return (!field || field === "amount") && !wordsOf(name).words.some((word) => NO_AMOUNTS.has(word));
}

/**
 * The material that a name of a column of amounts says, without the words of an amount and what is in brackets.
 * @param {string} name of a column, as `Need water (l)`
 * @returns {string} "" where it says none
 */
export function materialOf(name) {
  const words = name.replace(/\([^)]*\)|\[[^\]]*\]/g, " ").split(/[\s_:;,./-]+/).filter(Boolean);
  const left = words.filter((word) => !WORDS.amount.includes(plainName(word)));
  if (left.length < words.length) {
    while (left.length && JOINING.has(plainName(left[0]))) left.shift();
    if (left.length) left[0] = left[0].replace(/^d['\u2019](?=.)/i, "");
  }
  const material = left.join(" ");
  return /\p{L}/u.test(material) ? material : "";
}
