"""The story `palletizing`: a cell in which an arm stacks boxes on a pallet."""
