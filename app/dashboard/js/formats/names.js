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

/** What a name of a column says: its words, and the number at its end if it has one. */
function wordsOf(name) {
  const plain = name.normalize("NFD").replace(/\p{M}/gu, "").toLowerCase();
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
