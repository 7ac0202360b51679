"""The physics as witness: the paper's theorems as boundaries that MuJoCo obeys, through the whole hand."""
