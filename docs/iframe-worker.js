// Search when the site is opened from a disk: browsers start no worker from there, so that the
// program of the search runs in a frame that is not seen, and talks as a worker does.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      const frame = document.body.appendChild(document.createElement("iframe"))
      frame.hidden = true
      this.inside = frame.contentWindow
      this.inside.answer = data => this.dispatchEvent(new MessageEvent("message", { data }))
      this.ready = new Promise(done => (frame.onload = done))
      const page = this.inside.document
      page.open()
      page.write("<script>var postMessage = answer, importScripts = () => Promise.resolve()</script>")
      page.write(`<script src="${url}"></script>`)
      page.close()
    }

    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })))
    }
  }
}
