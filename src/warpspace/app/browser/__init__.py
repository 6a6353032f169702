"""What viser's public interface does not offer: scripts, the page's style, private parts."""
