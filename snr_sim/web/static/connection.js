// The WebSocket to the run: messages in both directions, and a new attempt when it is lost.

const FIRST_RETRY_MS = 300;
const MAX_RETRY_MS = 5000;

export class Connection {
  /** `receive` is called with each message, `report` with "open", "lost" or the reason why the run has ended. */
  constructor(receive, report) {
    Object.assign(this, { receive, report, retry_ms: FIRST_RETRY_MS, isOver: false });
    this.open();
  }

  open() {
    this.socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
    this.socket.onopen = () => this.report("open");
    this.socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      this.retry_ms = FIRST_RETRY_MS;
      this.isOver = message.kind === "gone";
      if (this.isOver) this.report(message.reason);
      else this.receive(message);
    };
    this.socket.onclose = () => {
      if (this.isOver) return;
      this.report("lost");
      setTimeout(() => this.open(), this.retry_ms);
      this.retry_ms = Math.min(2 * this.retry_ms, MAX_RETRY_MS);
    };
  }

  /** Send a message; return whether it could be sent. */
  send(kind, fields = {}) {
    const isOpen = this.socket.readyState === WebSocket.OPEN;
    if (isOpen) this.socket.send(JSON.stringify({ kind, ...fields }));
    return isOpen;
  }
}
