"""The paper's figures and numbers, reproduced."""
