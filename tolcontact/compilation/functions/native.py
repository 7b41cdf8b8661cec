"""Symbolic Functions as machine code: the instructions that CasADi would interpret, compiled by LLVM.

A Function of scalar expressions is straight-line code of several thousand additions and multiplications. CasADi interprets it
at 5 ns per instruction. Compiled code takes a tenth of that, and compiling takes 30 us per instruction. The operations and
their order are the same, so that the results are the same to the last bit.

LLVM's time for straight-line code grows faster than its length. So the code is cut into segments, separate functions that pass
numbers through memory.

A Function may be evaluated for several elements of every realization, each with its own columns in shared arrays: the machine
code gathers its inputs and scatters its results.
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
from tolcontact.compilation.functions.argument_columns import ArgumentColumns, Located

LANES = 4
SEGMENT = 1000  # instructions
_INDEX = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_LANES = ir.VectorType(_DOUBLE, LANES)
_POINTERS = _DOUBLE.as_pointer().as_pointer(), _INDEX.as_pointer(), _INDEX.as_pointer().as_pointer()
VECTOR_ALIGNMENT = 8  # bytes: guaranteed alignment of memory on the stack


class UnknownInstructionError(Exception):
    """A Function has an instruction without a translation; CasADi can still interpret it."""


class NativeFunction:
    """A compiled Function, called for many realizations at once."""

    def __init__(self, function: ca.Function, code: bytes | None = None) -> None:
        """Load the given machine code of the Function, or compile the Function and store its code in the cache.

        Raises UnknownInstructionError for a Function that cannot be compiled.
        """
        self.sizes_in = [function.nnz_in(i) for i in range(function.n_in())]
        self.sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._engine = _loaded(code) if code else _compiled(_module(function), key_of(function))
        address = self._engine.get_function_address("evaluate")
        self._evaluate = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 3)(address)
        self._whole = ArgumentColumns.of_one([*self.sizes_in, *self.sizes_out])

    @classmethod
    def from_cache(cls, function: ca.Function, key: str | None = None) -> "NativeFunction | None":
        """Return the compiled Function from the code of an earlier process, stored under its key; None if there is none."""
        code = code_cache.load(key or key_of(function))
        return None if code is None else cls(function, code)

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return results (realization, stored entry) for inputs (realization, stored entry)."""
        count = len(inputs[0])
        inputs = [np.ascontiguousarray(array, dtype=float) for array in inputs]
        results = [np.empty((count, size)) for size in self.sizes_out]
        self.evaluate(count, [Located.of(array) for array in (*inputs, *results)], self._whole)
        return results

    def evaluate(self, count: int, arrays: Sequence[Located], arguments: ArgumentColumns) -> None:
        """Read inputs from the first arrays, and write results into the others, in the columns of all elements.

        Inputs of one row are the same for all realizations. Rows may have a stride, as in a slice of columns. Raises ValueError
        for arrays of another shape.
        """
        for (_, _, rows, columns, _), width in zip(arrays, arguments.widths, strict=True):
            if columns < width or rows not in (1, count):
                raise ValueError(f"an array ({rows}, {columns}); expected {count} rows, or one, and at least {width} columns")
        addresses = (ctypes.c_void_p * len(arrays))(*[array.address for array in arrays])
        steps = (ctypes.c_int64 * len(arrays))(*[array.step for array in arrays])
        self._evaluate(count, arguments.elements, addresses, steps, arguments.addresses)


def _module(function: ca.Function) -> ir.Module:
    """Return a module with `void evaluate(count, elements, arrays, steps, tables)`: all instructions, for LANES realizations.

    The arguments are in `arrays` with row strides `steps`, in the columns given by their `tables` (element, entry). In the last
    iteration over realizations, lanes beyond `count` repeat the last realization.
    """
    module = ir.Module("contact")
    evaluate = ir.Function(module, ir.FunctionType(ir.VoidType(), [_INDEX, _INDEX, *_POINTERS]), "evaluate")
    count, elements, *arguments = evaluate.args
    entry, outer, body, following_element, done = (
        evaluate.append_basic_block(name) for name in ("entry", "outer", "body", "following", "done")
    )
    builder = ir.IRBuilder(entry)
    memory = builder.alloca(_LANES, _INDEX(max(function.sz_w(), 1)))
    last = builder.sub(count, _INDEX(1))
    nothing = builder.or_(builder.icmp_signed("<=", count, _INDEX(0)), builder.icmp_signed("<=", elements, _INDEX(0)))
    builder.cbranch(nothing, done, outer)
    builder.position_at_end(outer)
    element = builder.phi(_INDEX)
    element.add_incoming(_INDEX(0), entry)
    builder.branch(body)
    builder.position_at_end(body)
    k = builder.phi(_INDEX)
    k.add_incoming(_INDEX(0), outer)
    lanes = [builder.add(k, _INDEX(lane)) for lane in range(LANES)]
    lanes = [builder.select(builder.icmp_signed("<", lane, last), lane, last) for lane in lanes]
    for segment in _segments(function, module):
        builder.call(segment, [*arguments, memory, element, *lanes])
    following = builder.add(k, _INDEX(LANES))
    k.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, count), body, following_element)
    builder.position_at_end(following_element)
    next_element = builder.add(element, _INDEX(1))
    element.add_incoming(next_element, following_element)
    builder.cbranch(builder.icmp_signed("<", next_element, elements), outer, done)
    ir.IRBuilder(done).ret_void()
    return module


class Instruction(NamedTuple):
    """An instruction of a Function: the work entries that it writes and reads; for inputs and outputs, argument and entry."""

    operation: int
    to: list[int]
    operands: list[int]


def _segments(function: ca.Function, module: ir.Module) -> list[ir.Function]:
    """Return functions `void (arrays, steps, tables, memory, element, lanes...)` that together execute all instructions.

    A segment stores the work entries that later segments read in `memory`.
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
    for k, (part, outputs) in enumerate(zip(parts, stored, strict=True)):
        segments.append(_segment(function, module, f"segment{k}", (start, part), outputs))
        start += len(part)
    return segments


def _accesses(part: Sequence[Instruction]) -> tuple[set[int], set[int]]:
    """Return the work entries that instructions read before they write them, and the work entries that they write."""
    reads, writes = set[int](), set[int]()
    for operation, to, operands in part:
        if operation not in (ca.OP_INPUT, ca.OP_CONST):
            reads.update(index for index in operands if index not in writes)
        if operation != ca.OP_OUTPUT:
            writes.update(to)
    return reads, writes


def _segment(
    function: ca.Function, module: ir.Module, name: str, part: tuple[int, Sequence[Instruction]], stored: set[int]
) -> ir.Function:
    """Return the function of the instructions from a start index; it stores the work entries in `stored`."""
    arguments = [*_POINTERS, _LANES.as_pointer(), _INDEX, *[_INDEX] * LANES]
    segment = ir.Function(module, ir.FunctionType(ir.VoidType(), arguments), name)
    segment.linkage = "internal"
    segment.attributes.add("noinline")
    arrays, steps, tables, memory, element, *lanes = segment.args
    builder = ir.IRBuilder(segment.append_basic_block("entry"))
    sizes = [function.nnz_in(i) for i in range(function.n_in())] + [function.nnz_out(i) for i in range(function.n_out())]
    work, addresses = _Work(builder, memory), _Addresses(builder, (arrays, steps, tables), sizes, (element, *lanes))
    _translate(function, builder, part, work, addresses)
    for index in sorted(stored):
        builder.store(work[index], builder.gep(memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)
    builder.ret_void()
    return segment


class _Work(dict[int, ir.Value]):
    """The work entries of a segment; entries of earlier segments are loaded from memory when they are first read."""

    def __init__(self, builder: ir.IRBuilder, memory: ir.Value) -> None:
        super().__init__()
        self._builder, self._memory = builder, memory

    def __missing__(self, index: int) -> ir.Value:
        self[index] = self._builder.load(self._builder.gep(self._memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)
        return self[index]


class _Addresses:
    """The addresses of entries of arguments for each lane; rows of an argument are computed when a segment first needs them."""

    def __init__(
        self, builder: ir.IRBuilder, pointers: Sequence[ir.Value], sizes: Sequence[int], indices: Sequence[ir.Value]
    ) -> None:
        self._builder, self._sizes = builder, sizes
        self._arrays, self._steps, self._tables = pointers
        self._element, *self._lanes = indices
        self._rows: dict[int, tuple[ir.Value, list[ir.Value]]] = {}

    def __call__(self, argument: int, entry: int) -> list[ir.Value]:
        table, rows = self._of_argument(argument)
        column = self._builder.load(self._builder.gep(table, [_INDEX(entry)]))
        return [self._builder.gep(row, [column]) for row in rows]

    def _of_argument(self, argument: int) -> tuple[ir.Value, list[ir.Value]]:
        """Return the table of the element, and the row of each lane."""
        if argument not in self._rows:
            builder = self._builder
            array, step, table = (
                builder.load(builder.gep(pointers, [_INDEX(argument)]))
                for pointers in (self._arrays, self._steps, self._tables)
            )
            start = builder.gep(table, [builder.mul(self._element, _INDEX(self._sizes[argument]))])
            self._rows[argument] = start, [builder.gep(array, [builder.mul(lane, step)]) for lane in self._lanes]
        return self._rows[argument]


def _translate(
    function: ca.Function,
    builder: ir.IRBuilder,
    part: tuple[int, Sequence[Instruction]],
    work: _Work,
    addresses: _Addresses,
) -> None:
    """Emit the instructions of a Function from a start index."""
    (start, instructions), inputs = part, function.n_in()
    for k, (operation, to, operands) in enumerate(instructions, start):
        if operation == ca.OP_OUTPUT:
            for lane, address in enumerate(addresses(inputs + to[0], to[1])):
                builder.store(builder.extract_element(work[operands[0]], ir.IntType(32)(lane)), address)
        elif operation == ca.OP_INPUT:
            value = _LANES(ir.Undefined)
            for lane, address in enumerate(addresses(operands[0], operands[1])):
                value = builder.insert_element(value, builder.load(address), ir.IntType(32)(lane))
            work[to[0]] = value
        elif operation == ca.OP_CONST:
            work[to[0]] = _constant(function.instruction_constant(k))
        elif operation in OPERATIONS:
            work[to[0]] = OPERATIONS[operation](builder, *(work[index] for index in operands))
        else:
            raise UnknownInstructionError(f"instruction {operation}")


def _constant(value: float) -> ir.Constant:
    return _LANES([_DOUBLE(value)] * LANES)


ZERO, ONE = _constant(0.0), _constant(1.0)


def _truth(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return 1.0 or 0.0 for a truth value."""
    return builder.select(value, ONE, ZERO)


def _holds(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return builder.fcmp_unordered("!=", x, ZERO)


def _extreme(builder: ir.IRBuilder, sign: str, x: ir.Value, y: ir.Value) -> ir.Value:
    """Return C's fmin ("<=") or fmax (">="): the other operand if one is NaN, and the first of two equal operands."""
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
    """Return the key of a Function's machine code for a host, by default the host of this process."""
    return hashlib.blake2b(function.serialize().encode() + (host or host_description()), digest_size=20).hexdigest()


@functools.cache
def host_description() -> bytes:
    """Return a description of the processor, the libraries and this translation, which also determine the machine code."""
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
    # More optimization would double the compile time, for code that is no faster.
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=1
    )
    return binding.create_mcjit_compiler(binding.parse_assembly(module), target)
