/** Where labels have room beside what they name. No page. */

const CELL = 64;

/** Boxes within a larger one, and whether another one meets any of them, or its border. */
export class Taken {
  /** @param {{left: number, top: number, right: number, bottom: number}} inside */
  constructor(inside) {
    this.inside = inside;
    this.cells = new Map();
  }

  /** @param {{left: number, top: number, right: number, bottom: number}} box */
  add(box) {
    for (const key of cellsOf(box)) {
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push(box);
    }
  }

  meets(box) {
    if (box.left < this.inside.left || box.right > this.inside.right || box.top < this.inside.top || box.bottom > this.inside.bottom) return true;
    for (const key of cellsOf(box)) {
      for (const other of this.cells.get(key) ?? []) if (other.left < box.right && other.right > box.left && other.top < box.bottom && other.bottom > box.top) return true;
    }
    return false;
  }
}

function cellsOf({ left, top, right, bottom }) {
  const keys = [];
  for (let x = Math.floor(left / CELL); x <= Math.floor(right / CELL); x += 1) for (let y = Math.floor(top / CELL); y <= Math.floor(bottom / CELL); y += 1) keys.push(`${x} ${y}`);
  return keys;
}

/** Boxes for a label of a size beside a symbol: right, left, below, above. @param {{x: number, y: number, half: number}} symbol its middle and half its size */
function beside({ x, y, half }, width, height) {
  const at = (left, top) => ({ left, top, right: left + width, bottom: top + height });
  return [at(x + half + 2, y - height / 2), at(x - half - 2 - width, y - height / 2), at(x - width / 2, y + half + 1), at(x - width / 2, y - half - 1 - height)];
}

/**
 * Give labels their places, the first ones first; who has no room beside its symbol has none.
 * @param {Taken} taken what is there already; gets the labels
 * @param {{x: number, y: number, half: number, sizes: {width: number, height: number}[], always?: boolean}[]} labels with the sizes that they
 *   may have, the best first, and whether a label is there even where it covers something
 * @returns {({left: number, top: number, right: number, bottom: number, size: number} | null)[]} one a label, with the number of its size
 */
export function layOut(taken, labels) {
  return labels.map((label) => {
    for (const [size, { width, height }] of label.sizes.entries()) {
      const box = beside(label, width, height).find((each) => !taken.meets(each));
      if (!box) continue;
      taken.add(box);
      return { ...box, size };
    }
    const size = label.sizes.length - 1;
    return label.always ? { ...beside(label, label.sizes[size].width, label.sizes[size].height)[0], size } : null;
  });
}
