"""Windows of steps for training, straight from a database or from an export.

`sources` reads episodes; `windows` cuts windows out of them: `WindowDataset` by number, `WindowStream` in
order. DataLoader of torch takes both, and neither needs torch.
"""
