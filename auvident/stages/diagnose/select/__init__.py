"""Select: which effects the model lacks, by rules that stand in a table."""
