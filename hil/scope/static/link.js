// Connection to the server: JSON messages and binary frames; it connects again by itself.

const token = new URLSearchParams(location.search).get("token");
export const query = token ? `?token=${encodeURIComponent(token)}` : "";
const RETRY_MS = 500;

// Frame: length of the header (uint32, little endian), header as JSON, rows of float64.
function readFrame(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const [rows, columns] = header.shape;
  header.rows = Array.from({ length: rows }, (_, row) => new Float64Array(buffer, 4 + size + 8 * row * columns, columns));
  return header;
}

// on: functions by kind of message; `connected` with true or false.
export function connect(on) {
  let socket = null;
  const open = () => {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/rows${query}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => on.connected(true);
    socket.onmessage = ({ data }) => {
      const message = typeof data === "string" ? JSON.parse(data) : readFrame(data);
      on[message.kind](message);
    };
    socket.onclose = () => {
      on.connected(false);
      setTimeout(open, RETRY_MS);
    };
  };
  open();
  return (message) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
}
