"""Documents of the app: files, links, legends and offline pages."""
