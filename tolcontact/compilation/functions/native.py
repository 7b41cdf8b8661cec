"""Symbolic Functions as machine code: the instructions that CasADi would interpret, compiled by LLVM.

A Function of scalar expressions is a straight line of some thousand additions and multiplications. CasADi interprets it at
5 ns an instruction; compiled it takes a tenth of that (and 30 us of compiling), with the same operations in the same order, so
that the results are the same to the last bit.

LLVM's time for a straight line grows faster than its length. So it is cut into segments, functions of their own, which pass
numbers on in memory.
"""

import ctypes
import functools
import hashlib
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np
from llvmlite import binding, ir

from tolcontact import code_cache

LANES = 4
SEGMENT = 1000  # instructions
_INDEX = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_LANES = ir.VectorType(_DOUBLE, LANES)
VECTOR_ALIGNMENT = 8  # bytes: what is sure of memory on the stack


class UnknownInstructionError(Exception):
    """A Function has an instruction that is not translated; CasADi can still interpret it."""


class NativeFunction:
    """A compiled Function, called for many realizations at once: `inputs` and results are (realization, stored entry)."""

    def __init__(self, function: ca.Function, code: bytes | None = None) -> None:
        """Load the given machine code of the Function, or compile the Function and store its code in the cache.

        Raises UnknownInstructionError for a Function that cannot be compiled.
        """
        self.sizes_in = [function.nnz_in(i) for i in range(function.n_in())]
        self.sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._engine = _loaded(code) if code else _compiled(_module(function), key_of(function))
        address = self._engine.get_function_address("evaluate")
        pointers = ctypes.POINTER(ctypes.c_void_p)
        self._evaluate = ctypes.CFUNCTYPE(None, ctypes.c_int64, pointers, pointers)(address)

    @classmethod
    def from_cache(cls, function: ca.Function) -> "NativeFunction | None":
        """Return the compiled Function from the code of an earlier process; None if there is none."""
        code = code_cache.load(key_of(function))
        return None if code is None else cls(function, code)

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        count = len(inputs[0])
        inputs = [np.ascontiguousarray(array, dtype=float) for array in inputs]
        results = [np.empty((count, size)) for size in self.sizes_out]
        self._evaluate(count, _pointers(inputs), _pointers(results))
        return results


def _pointers(arrays: Sequence[np.ndarray]) -> ctypes.Array:
    return (ctypes.c_void_p * len(arrays))(*(array.ctypes.data for array in arrays))


def _module(function: ca.Function) -> ir.Module:
    """Return a module with `void evaluate(count, inputs, results)`: all instructions, for LANES realizations at once.

    In the last turn of the loop the lanes beyond `count` repeat the last realization.
    """
    module = ir.Module("contact")
    pointer = _DOUBLE.as_pointer()
    evaluate = ir.Function(
        module, ir.FunctionType(ir.VoidType(), [_INDEX, pointer.as_pointer(), pointer.as_pointer()]), "evaluate"
    )
    count, inputs, results = evaluate.args
    entry, body, done = (evaluate.append_basic_block(name) for name in ("entry", "body", "done"))
    builder = ir.IRBuilder(entry)
    memory = builder.alloca(_LANES, _INDEX(max(function.sz_w(), 1)))
    last = builder.sub(count, _INDEX(1))
    builder.cbranch(builder.icmp_signed(">", count, _INDEX(0)), body, done)
    builder.position_at_end(body)
    k = builder.phi(_INDEX)
    k.add_incoming(_INDEX(0), entry)
    lanes = [builder.add(k, _INDEX(lane)) for lane in range(LANES)]
    lanes = [builder.select(builder.icmp_signed("<", lane, last), lane, last) for lane in lanes]
    for segment in _segments(function, module):
        builder.call(segment, [inputs, results, memory, *lanes])
    following = builder.add(k, _INDEX(LANES))
    k.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, count), body, done)
    ir.IRBuilder(done).ret_void()
    return module


class Instruction(NamedTuple):
    """An instruction of a Function: work entries that it writes and reads; of inputs and outputs the argument and its entry."""

    operation: int
    to: list[int]
    operands: list[int]


def _segments(function: ca.Function, module: ir.Module) -> list[ir.Function]:
    """Return functions `void (inputs, results, memory, lanes...)` that together are all instructions of a Function.

    A segment stores in `memory` the work entries that later segments read.
    """
    instructions = [
        Instruction(function.instruction_id(k), function.instruction_output(k), function.instruction_input(k))
        for k in range(function.n_instructions())
    ]
    parts = [instructions[k : k + SEGMENT] for k in range(0, len(instructions), SEGMENT)]
    read_later: set[int] = set()
    stored: list[set[int]] = []
    for part in reversed(parts):
        reads, writes = _accesses(part)
        stored.insert(0, writes & read_later)
        read_later = read_later - writes | reads
    segments, start = [], 0
    for number, (part, kept) in enumerate(zip(parts, stored, strict=True)):
        segments.append(_segment(function, module, f"segment{number}", (start, part), kept))
        start += len(part)
    return segments


def _accesses(part: Sequence[Instruction]) -> tuple[set[int], set[int]]:
    """Return the work entries that instructions read before they write them, and those that they write."""
    reads, writes = set[int](), set[int]()
    for operation, to, operands in part:
        if operation not in (ca.OP_INPUT, ca.OP_CONST):
            reads.update(index for index in operands if index not in writes)
        if operation != ca.OP_OUTPUT:
            writes.update(to)
    return reads, writes


def _segment(
    function: ca.Function, module: ir.Module, name: str, part: tuple[int, Sequence[Instruction]], kept: set[int]
) -> ir.Function:
    """Return the function of the instructions from a number on, which stores the work entries that are `kept`."""
    pointers = _DOUBLE.as_pointer().as_pointer()
    arguments = [pointers, pointers, _LANES.as_pointer(), *[_INDEX] * LANES]
    segment = ir.Function(module, ir.FunctionType(ir.VoidType(), arguments), name)
    segment.linkage = "internal"
    segment.attributes.add("noinline")
    inputs, results, memory, *lanes = segment.args
    builder = ir.IRBuilder(segment.append_basic_block("entry"))
    sizes = ([function.nnz_in(i) for i in range(function.n_in())], [function.nnz_out(i) for i in range(function.n_out())])
    places = [_Places(builder, array, of_array, lanes) for array, of_array in zip((inputs, results), sizes, strict=True)]
    work = _Work(builder, memory)
    _translate(function, builder, part, work, *places)
    for index in sorted(kept):
        builder.store(work[index], builder.gep(memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)
    builder.ret_void()
    return segment


class _Work(dict[int, ir.Value]):
    """The work entries of a segment; those of earlier segments are loaded from memory when they are first read."""

    def __init__(self, builder: ir.IRBuilder, memory: ir.Value) -> None:
        super().__init__()
        self._builder, self._memory = builder, memory

    def __missing__(self, index: int) -> ir.Value:
        self[index] = self._builder.load(self._builder.gep(self._memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)
        return self[index]


class _Places:
    """The addresses of arguments for each lane, computed when a segment first needs them."""

    def __init__(self, builder: ir.IRBuilder, arrays: ir.Value, sizes: Sequence[int], lanes: Sequence[ir.Value]) -> None:
        self._builder, self._arrays, self._sizes, self._lanes = builder, arrays, sizes, lanes
        self._known: dict[int, list[ir.Value]] = {}

    def __getitem__(self, argument: int) -> list[ir.Value]:
        if argument not in self._known:
            builder = self._builder
            start = builder.load(builder.gep(self._arrays, [_INDEX(argument)]))
            size = _INDEX(self._sizes[argument])
            self._known[argument] = [builder.gep(start, [builder.mul(lane, size)]) for lane in self._lanes]
        return self._known[argument]


def _translate(
    function: ca.Function,
    builder: ir.IRBuilder,
    part: tuple[int, Sequence[Instruction]],
    work: _Work,
    inputs: _Places,
    results: _Places,
) -> None:
    """Emit instructions of a Function from a number on; `inputs` and `results` hold the address of each argument and lane."""
    start, instructions = part
    for number, (operation, to, names) in enumerate(instructions, start):
        if operation == ca.OP_OUTPUT:
            for lane, place in enumerate(results[to[0]]):
                value = builder.extract_element(work[names[0]], ir.IntType(32)(lane))
                builder.store(value, builder.gep(place, [_INDEX(to[1])]))
        elif operation == ca.OP_INPUT:
            value = _LANES(ir.Undefined)
            for lane, place in enumerate(inputs[names[0]]):
                loaded = builder.load(builder.gep(place, [_INDEX(names[1])]))
                value = builder.insert_element(value, loaded, ir.IntType(32)(lane))
            work[to[0]] = value
        elif operation == ca.OP_CONST:
            work[to[0]] = _constant(function.instruction_constant(number))
        elif operation in OPERATIONS:
            work[to[0]] = OPERATIONS[operation](builder, *(work[index] for index in names))
        else:
            raise UnknownInstructionError(f"instruction {operation}")


def _constant(value: float) -> ir.Constant:
    return _LANES([_DOUBLE(value)] * LANES)


ZERO, ONE = _constant(0.0), _constant(1.0)


def _truth(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return 1.0 or 0.0 for a bit."""
    return builder.select(value, ONE, ZERO)


def _holds(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return builder.fcmp_unordered("!=", x, ZERO)


def _extreme(builder: ir.IRBuilder, sign: str, x: ir.Value, y: ir.Value) -> ir.Value:
    """Return C's fmin ("<=") or fmax (">="): the other number for a NaN, and the first of two equal numbers."""
    return builder.select(builder.or_(builder.fcmp_ordered(sign, x, y), builder.fcmp_unordered("uno", y, y)), x, y)


def _call(name: str) -> Callable[[ir.IRBuilder, ir.Value], ir.Value]:
    def call(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
        full = f"llvm.{name}.v{LANES}f64"
        declared = builder.module.globals.get(full) or ir.Function(builder.module, ir.FunctionType(_LANES, [_LANES]), full)
        return builder.call(declared, [x])

    return call


OPERATIONS: dict[int, Callable[..., ir.Value]] = {
    ca.OP_ASSIGN: lambda b, x: x,
    ca.OP_ADD: lambda b, x, y: b.fadd(x, y),
    ca.OP_SUB: lambda b, x, y: b.fsub(x, y),
    ca.OP_MUL: lambda b, x, y: b.fmul(x, y),
    ca.OP_DIV: lambda b, x, y: b.fdiv(x, y),
    ca.OP_NEG: lambda b, x: b.fneg(x),
    ca.OP_SQ: lambda b, x: b.fmul(x, x),
    ca.OP_TWICE: lambda b, x: b.fadd(x, x),
    ca.OP_INV: lambda b, x: b.fdiv(ONE, x),
    ca.OP_FMIN: lambda b, x, y: _extreme(b, "<=", x, y),
    ca.OP_FMAX: lambda b, x, y: _extreme(b, ">=", x, y),
    ca.OP_LT: lambda b, x, y: _truth(b, b.fcmp_ordered("<", x, y)),
    ca.OP_LE: lambda b, x, y: _truth(b, b.fcmp_ordered("<=", x, y)),
    ca.OP_EQ: lambda b, x, y: _truth(b, b.fcmp_ordered("==", x, y)),
    ca.OP_NE: lambda b, x, y: _truth(b, b.fcmp_unordered("!=", x, y)),
    ca.OP_NOT: lambda b, x: _truth(b, b.not_(_holds(b, x))),
    ca.OP_AND: lambda b, x, y: _truth(b, b.and_(_holds(b, x), _holds(b, y))),
    ca.OP_OR: lambda b, x, y: _truth(b, b.or_(_holds(b, x), _holds(b, y))),
    ca.OP_IF_ELSE_ZERO: lambda b, x, y: b.select(_holds(b, x), y, ZERO),
    **{getattr(ca, f"OP_{name.upper()}"): _call(name) for name in ("sqrt", "fabs", "sin", "cos", "exp", "log")},
}


def key_of(function: ca.Function, host: bytes | None = None) -> str:
    """Return the key of a Function's machine code for a host: that of this process by default."""
    return hashlib.blake2b(function.serialize().encode() + (host or host_description()), digest_size=20).hexdigest()


@functools.cache
def host_description() -> bytes:
    """Return a description of the processor, the libraries and the translation, on which machine code depends, too."""
    translation = Path(__file__).read_bytes()
    features = binding.get_host_cpu_features().flatten()
    parts = [binding.get_default_triple(), binding.get_host_cpu_name(), features, version("llvmlite"), version("casadi")]
    return "\n".join(parts).encode() + translation


def _compiled(module: ir.Module, key: str) -> binding.ExecutionEngine:
    engine = _engine(str(module))
    engine.set_object_cache(notify_func=lambda _, code: code_cache.store(key, code))
    engine.finalize_object()
    return engine


def _loaded(code: bytes) -> binding.ExecutionEngine:
    engine = _engine("")
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _engine(module: str) -> binding.ExecutionEngine:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    # More optimization would take as long again, for code that is no faster.
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=1
    )
    return binding.create_mcjit_compiler(binding.parse_assembly(module), target)
