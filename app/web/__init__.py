"""HTTP, server-sent events, WebSockets, cookies, security headers and metrics."""
