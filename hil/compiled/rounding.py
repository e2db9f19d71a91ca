"""Rounding of products, which keeps the compiler from fusing them into sums.

LLVM turns a*b + c into one fused multiply-add depending on the code around it: the same function inlined in two places
gives results that differ in the last bit. The control law must give the same bits everywhere.
"""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload


def rounded(product: float) -> float:
    """Round a product to float64 before its next use."""
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
