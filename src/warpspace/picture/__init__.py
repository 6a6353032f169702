"""One picture in numbers: what every renderer, export and page draws. numpy only."""
