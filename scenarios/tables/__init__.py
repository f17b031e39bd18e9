"""Tables II to IV of the paper, measured on the simulated sequences beside the paper's figures."""
