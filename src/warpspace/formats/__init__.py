"""Files of measuring instruments and controllers: read to errors, written as compensation."""
