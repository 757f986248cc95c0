"""The kiosk's screen: starts the compositor and the browser, looks at the page, restarts what hangs.

It reads nothing but Python's own library: it runs beside the server for as long as the machine does.
"""
