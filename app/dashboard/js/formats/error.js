/** A file that cannot be read; the message says where and what is wrong. */
export class FormatError extends Error {}
