// The payload of the page: facts, and arrays by name (see packing.py).
async function unpack(text) {
  const letters = atob(text.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const data = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = new DataView(data.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + size)));
  const arrays = {};
  for (const [name, entry] of Object.entries(head.arrays)) {
    arrays[name] = unpackArray(entry, data, 4 + size);
  }
  return { facts: head.facts, arrays };
}

function unpackArray(entry, data, start) {
  const rows = entry.shape[0];
  const columns = entry.shape.length > 1 ? entry.shape[1] : 1;
  const count = rows * columns;
  const at = start + entry.at;
  if (entry.bytes === 1) return data.subarray(at, at + count);
  const isFloat = entry.step !== undefined;
  const mask = 2 ** (8 * entry.bytes) - 1;
  const result = isFloat ? new Float32Array(count) : new Uint32Array(count);
  for (let column = 0; column < columns; column++) {
    let whole = 0;
    for (let row = 0; row < rows; row++) {
      const place = at + column * rows + row;
      let difference = 0;
      for (let k = 0; k < entry.bytes; k++) difference |= data[place + k * count] << (8 * k);
      whole = (whole + difference) & mask;
      result[row * columns + column] = isFloat ? entry.low[column] + whole * entry.step : whole;
    }
  }
  return result;
}
