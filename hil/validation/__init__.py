"""How well the product works: sealed proof of the diagnosis, benchmarks, and the source paper reproduced."""
