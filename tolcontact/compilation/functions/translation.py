"""Translation of symbolic Functions into LLVM's intermediate code.

LLVM's time for straight-line code grows faster than its length. So the code is cut into segments, separate functions that pass
numbers through memory. A Function that another one calls is translated once, however often it is called.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate, groupby
from typing import NamedTuple

import casadi as ca
from llvmlite import ir

from tolcontact.compilation.functions.operations import DOUBLE, LANES, OPERATIONS, VECTOR, constant

SEGMENT = 1000  # instructions
MIN_MOVED = 8  # inputs or results in a row that a loop copies
VECTOR_ALIGNMENT = 8  # bytes: guaranteed alignment of the memory
_INDEX = ir.IntType(64)
_MEMORY = VECTOR.as_pointer()
_TRANSLATED = ir.FunctionType(ir.VoidType(), [_MEMORY] * 3)


def sizes_of(function: ca.Function) -> tuple[list[int], list[int]]:
    """Return the number of stored entries of each input and of each output."""
    return [*map(function.nnz_in, range(function.n_in()))], [*map(function.nnz_out, range(function.n_out()))]


def module_of(function: ca.Function) -> ir.Module:
    """Return a module with `void evaluate(count, arrays, memory)`: all instructions, for LANES realizations at once.

    `arrays` are inputs and results. In the last iteration, lanes beyond `count` repeat the last realization. Raises
    NotImplementedError for an instruction without a translation; CasADi can still interpret it.
    """
    module = ir.Module("contact")
    translated = _Translation(module).function(function)
    signature = ir.FunctionType(ir.VoidType(), [_INDEX, DOUBLE.as_pointer().as_pointer(), _MEMORY])
    evaluate = ir.Function(module, signature, "evaluate")
    count, arrays, memory = evaluate.args
    inputs, outputs = sizes_of(function)
    types = [DOUBLE.as_pointer(), _MEMORY, *[_INDEX] * LANES]
    gather, scatter = _loop(module, "gather", types, _gather), _loop(module, "scatter", types, _scatter)
    starts = [0, *accumulate([*inputs, *outputs])]

    def evaluate_lanes(builder: ir.IRBuilder, first: ir.Value) -> None:
        last = builder.sub(count, _INDEX(1))
        lanes = [builder.add(first, _INDEX(lane)) for lane in range(LANES)]
        lanes = [builder.select(builder.icmp_signed("<", lane, last), lane, last) for lane in lanes]
        results, work = (builder.gep(memory, [_INDEX(n)]) for n in (sum(inputs), starts[-1]))

        def copy(function: ir.Function, arguments: range) -> None:
            for i in arguments:
                array = builder.load(builder.gep(arrays, [_INDEX(i)]))
                place = builder.gep(memory, [_INDEX(starts[i])])
                builder.call(function, [_INDEX(starts[i + 1] - starts[i]), array, place, *lanes])

        copy(gather, range(len(inputs)))
        builder.call(translated, [memory, results, work])
        copy(scatter, range(len(inputs), len(inputs) + len(outputs)))

    _repeat(evaluate, count, LANES, evaluate_lanes)
    return module


def _repeat(function: ir.Function, count: ir.Value, step: int, emit: Callable[[ir.IRBuilder, ir.Value], None]) -> None:
    """Emit the code of a function: a loop over every index below a count, or every one of some `step`."""
    entry, body, done = (function.append_basic_block(name) for name in ("entry", "body", "done"))
    builder = ir.IRBuilder(entry)
    builder.cbranch(builder.icmp_signed("<=", count, _INDEX(0)), done, body)
    builder.position_at_end(body)
    index = builder.phi(_INDEX)
    index.add_incoming(_INDEX(0), entry)
    emit(builder, index)
    following = builder.add(index, _INDEX(step))
    index.add_incoming(following, body)
    builder.cbranch(builder.icmp_signed("<", following, count), body, done)
    ir.IRBuilder(done).ret_void()


def _loop(module: ir.Module, name: str, types: Sequence[ir.Type], emit: Callable[..., None]) -> ir.Function:
    """Return a function `void (size, arguments...)` that repeats some code for each index below the size."""
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [_INDEX, *types]), name)
    function.linkage = "internal"
    function.attributes.add("noinline")
    size, *arguments = function.args
    _repeat(function, size, 1, lambda builder, index: emit(builder, index, size, arguments))
    return function


def _gather(builder: ir.IRBuilder, column: ir.Value, size: ir.Value, arguments: Sequence[ir.Value]) -> None:
    """Emit the copy of a column from some rows of an array to memory."""
    array, memory, *rows = arguments
    value = VECTOR(ir.Undefined)
    for lane, row in enumerate(rows):
        address = builder.gep(array, [builder.add(builder.mul(row, size), column)])
        value = builder.insert_element(value, builder.load(address), ir.IntType(32)(lane))
    builder.store(value, builder.gep(memory, [column]), align=VECTOR_ALIGNMENT)


def _scatter(builder: ir.IRBuilder, column: ir.Value, size: ir.Value, arguments: Sequence[ir.Value]) -> None:
    """Emit the copy of a column from memory to some rows of an array."""
    array, memory, *rows = arguments
    value = builder.load(builder.gep(memory, [column]), align=VECTOR_ALIGNMENT)
    for lane, row in enumerate(rows):
        address = builder.gep(array, [builder.add(builder.mul(row, size), column)])
        builder.store(builder.extract_element(value, ir.IntType(32)(lane)), address)


def _transfer(builder: ir.IRBuilder, k: ir.Value, size: ir.Value, arguments: Sequence[ir.Value]) -> None:
    """Emit the copy of an entry from one memory to another, at indices from two tables."""
    del size
    source, source_table, target, target_table = arguments
    first, second = (builder.load(builder.gep(table, [k])) for table in (source_table, target_table))
    value = builder.load(builder.gep(source, [first]), align=VECTOR_ALIGNMENT)
    builder.store(value, builder.gep(target, [second]), align=VECTOR_ALIGNMENT)


class Instruction(NamedTuple):
    """An instruction of a Function.

    to         the work entries that it writes; for an output, argument and entry
    operands   the work entries that it reads; for an input, argument and entry
    position   its index in the Function
    """

    operation: int
    to: list[int]
    operands: list[int]
    position: int


def _accesses(part: Sequence[Instruction]) -> tuple[set[int], set[int]]:
    """Return the work entries that instructions read before they write them, and the work entries that they write."""
    reads, writes = set[int](), set[int]()
    for operation, to, operands, _ in part:
        if operation not in (ca.OP_INPUT, ca.OP_CONST):
            reads.update(index for index in operands if index not in writes)
        if operation != ca.OP_OUTPUT:
            writes.update(index for index in to if index >= 0)
    return reads, writes


def called(function: ca.Function) -> list[ca.Function]:
    """Return the Function that each call in a Function calls."""
    if not function.find_functions(0):
        return []
    expressions = function.instructions_sx()
    calls = (k for k in range(function.n_instructions()) if function.instruction_id(k) == ca.OP_CALL)
    return [expressions[k].which_function() for k in calls]


def memory_of(function: ca.Function) -> int:
    """Return the memory that a Function needs: its work entries, and arguments and memory of the Functions that it calls."""
    own = function.find_functions(0)
    return function.sz_w() + max((f.nnz_in() + f.nnz_out() + memory_of(f) for f in own), default=0)


class _Translation:
    """The functions `void (inputs, results, memory)` of a module, each for a Function or a segment of its instructions."""

    def __init__(self, module: ir.Module) -> None:
        self._module, self._transfer = module, _loop(module, "transfer", [_MEMORY, _INDEX.as_pointer()] * 2, _transfer)
        self._functions: dict[int, ir.Function] = {}

    def function(self, function: ca.Function) -> ir.Function:
        """Return the translation of a Function."""
        key = function.__hash__()
        if key not in self._functions:
            segments, translated = self._segments(function), self._new()
            builder = ir.IRBuilder(translated.append_basic_block("entry"))
            for segment in segments:
                builder.call(segment, translated.args)
            builder.ret_void()
            self._functions[key] = translated
        return self._functions[key]

    def _new(self) -> ir.Function:
        function = ir.Function(self._module, _TRANSLATED, self._module.get_unique_name("segment"))
        function.linkage = "internal"
        function.attributes.add("noinline")
        for argument in function.args:
            argument.add_attribute("noalias")
        return function

    def _segments(self, function: ca.Function) -> list[ir.Function]:
        """Return functions that together execute all instructions; each stores the work entries that later ones read."""
        instructions = [
            Instruction(function.instruction_id(k), function.instruction_output(k), function.instruction_input(k), k)
            for k in range(function.n_instructions())
        ]
        parts = [instructions[k : k + SEGMENT] for k in range(0, len(instructions), SEGMENT)]
        read_later, stored = set[int](), list[set[int]]()
        for part in reversed(parts):
            reads, writes = _accesses(part)
            stored.insert(0, writes & read_later)
            read_later = read_later - writes | reads
        functions = iter(called(function))
        return [self._segment(function, part, kept, functions) for part, kept in zip(parts, stored, strict=True)]

    def _segment(
        self, function: ca.Function, part: Sequence[Instruction], stored: set[int], functions: Iterator[ca.Function]
    ) -> ir.Function:
        """Return the function of some instructions, which calls the next `functions`, and stores the entries in `stored`."""
        segment = self._new()
        inputs, results, memory = segment.args
        builder = ir.IRBuilder(segment.append_basic_block("entry"))
        starts_in, starts_out = ([0, *accumulate(sizes)] for sizes in sizes_of(function))
        work = _Work(builder, memory)
        for operation, run in groupby(part, lambda instruction: instruction.operation):
            instructions = [*run]
            if operation == ca.OP_INPUT and len(instructions) >= MIN_MOVED:
                entries = [starts_in[i] + entry for _, _, (i, entry), _ in instructions]
                self._move_in(builder, work, inputs, entries, [to for _, (to,), _, _ in instructions])
            elif operation == ca.OP_OUTPUT and len(instructions) >= MIN_MOVED:
                entries = [starts_out[i] + entry for _, (i, entry), _, _ in instructions]
                self._move_out(builder, work, [operand for _, _, (operand,), _ in instructions], results, entries)
            else:
                for _, to, operands, k in instructions:
                    if operation == ca.OP_CALL:
                        self._call(builder, work, next(functions), to, operands, function.sz_w())
                    elif operation == ca.OP_OUTPUT:
                        work.store(work[operands[0]], results, starts_out[to[0]] + to[1])
                    elif operation == ca.OP_INPUT:
                        work.write(to[0], work.load(inputs, starts_in[operands[0]] + operands[1]))
                    elif operation == ca.OP_CONST:
                        work.write(to[0], constant(function.instruction_constant(k)))
                    elif operation in OPERATIONS:
                        work.write(to[0], OPERATIONS[operation](builder, *(work[index] for index in operands)))
                    else:
                        raise NotImplementedError(f"instruction {operation} has no translation")
        work.flush(stored)
        builder.ret_void()
        return segment

    def _call(
        self, builder: ir.IRBuilder, work: "_Work", function: ca.Function, to: list[int], operands: list[int], start: int
    ) -> None:
        """Emit a call, with arguments, results and memory of the called Function from a start index in the memory."""
        offsets = start, start + len(operands), start + len(operands) + len(to)
        inputs, results, memory = (builder.gep(work.memory, [_INDEX(offset)]) for offset in offsets)
        self._move_out(builder, work, operands, inputs, range(len(operands)))
        builder.call(self.function(function), [inputs, results, memory])
        needed = [(k, index) for k, index in enumerate(to) if index >= 0]
        self._move_in(builder, work, results, [k for k, _ in needed], [index for _, index in needed])

    def _move_in(
        self, builder: ir.IRBuilder, work: "_Work", source: ir.Value, entries: Sequence[int], to: Sequence[int]
    ) -> None:
        """Move entries of some memory into work entries."""
        work.forget(to)
        tables = self._table(builder, entries), self._table(builder, to)
        builder.call(self._transfer, [_INDEX(len(to)), source, tables[0], work.memory, tables[1]])

    def _move_out(
        self, builder: ir.IRBuilder, work: "_Work", operands: Sequence[int], target: ir.Value, entries: Sequence[int]
    ) -> None:
        """Move work entries into entries of some memory."""
        work.flush(operands)
        tables = self._table(builder, operands), self._table(builder, entries)
        builder.call(self._transfer, [_INDEX(len(operands)), work.memory, tables[0], target, tables[1]])

    def _table(self, builder: ir.IRBuilder, indices: Sequence[int]) -> ir.Value:
        """Return the address of a constant table of indices."""
        values = ir.Constant(ir.ArrayType(_INDEX, len(indices)), [*indices])
        table = ir.GlobalVariable(self._module, values.type, self._module.get_unique_name("table"))
        table.linkage, table.global_constant, table.initializer = "internal", True, values
        return builder.gep(table, [_INDEX(0), _INDEX(0)])


class _Work(dict[int, ir.Value]):
    """The work entries of a segment that are in registers; others are loaded from memory when they are first read."""

    def __init__(self, builder: ir.IRBuilder, memory: ir.Value) -> None:
        super().__init__()
        self._builder, self.memory = builder, memory
        self._unstored: set[int] = set()

    def __missing__(self, index: int) -> ir.Value:
        self[index] = self.load(self.memory, index)
        return self[index]

    def write(self, index: int, value: ir.Value) -> None:
        """Set an entry."""
        self[index] = value
        self._unstored.add(index)

    def flush(self, indices: Iterable[int]) -> None:
        """Store these entries in memory, unless they are there."""
        for index in sorted(self._unstored.intersection(indices)):
            self.store(self[index], self.memory, index)
        self._unstored.difference_update(indices)

    def forget(self, indices: Iterable[int]) -> None:
        """Drop these entries, which are overwritten in memory."""
        for index in indices:
            self.pop(index, None)
        self._unstored.difference_update(indices)

    def load(self, memory: ir.Value, index: int) -> ir.Value:
        """Return an entry of some memory."""
        return self._builder.load(self._builder.gep(memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)

    def store(self, value: ir.Value, memory: ir.Value, index: int) -> None:
        """Store an entry in some memory."""
        self._builder.store(value, self._builder.gep(memory, [_INDEX(index)]), align=VECTOR_ALIGNMENT)
