"""Drawing artifacts in three dimensions: what is drawn on, a page for browsers, and maps, graphs and scenes."""
