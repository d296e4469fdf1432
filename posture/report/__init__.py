"""From the results of every experiment to one page: verdicts, tables, figures. `document.write_report` puts it together."""
