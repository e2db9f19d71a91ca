"""Round where the program says so: keeps the compiler from fusing a product into a sum.

LLVM turns a*b + c into one fused multiply-add where it sees fit, and that depends on the code around it: the same
function inlined in two places gives results that differ in the last bit. The control law must not.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload


def rounded(product: float) -> float:
    """The product itself, rounded to float64 before anything else is done with it."""
    return product


@intrinsic
def _fence(context: Any, product: Any) -> Any:
    def emit(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        fence = builder.module.declare_intrinsic("llvm.arithmetic.fence", [double], ir.FunctionType(double, [double]))
        return builder.call(fence, arguments)

    return types.float64(types.float64), emit


@overload(rounded)
def _rounded(product):  # type: ignore[no-untyped-def]   # numba compares the arguments with those of the lambda
    return lambda product: _fence(product)
