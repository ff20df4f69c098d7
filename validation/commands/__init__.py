"""One folder per command, named as the command, and nothing else to do to add or to delete one.

command.py : PLACE in the help, EXAMPLE, and `command`, the function whose arguments and docstring are its help; light.
study.py computes and stores; page.py draws what is stored (`sections(folder)`) and loads no solver.
"""
