"""Still pictures for papers: PNG, SVG and PDF, without a display."""
