"""A picture as numbers, the input of every renderer, export and page. numpy only."""
