"""What was written, read back: files, page and terminal against the stored fields and JSON files.

It imports nothing of what writes them.  Every reader yields faults, sentences.
A table or printed text without a reader is noted: a test fails then.
"""

from validation.core.readback.files import FILES, faults_of_stored_results, path_csv_columns
from validation.core.readback.find import find_faults
from validation.core.readback.limits import limit_faults, limit_table_faults
from validation.core.readback.lines import line_terminal_faults, moving_line_outcome_faults
from validation.core.readback.pages import page_faults
from validation.core.readback.side_view import rope_csv_and_side_view_faults
from validation.core.readback.stored import StoredResults
from validation.core.readback.tables import motion_design_table_faults
from validation.core.readback.terminal import terminal_faults
from validation.core.readback.texts import plain_text
from validation.core.readback.verification import verification_faults
